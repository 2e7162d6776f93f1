"""The optics of the scene: shutter, sensor, perspective, and the motion of the camera."""
