"""Event-driven molecular dynamics of inelastic hard spheres in a box."""
