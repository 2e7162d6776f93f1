"""The hard-sphere gas in its tray, and the camera over it."""
