"""Simulation of the hard-sphere gas in a tray, and of the camera."""
