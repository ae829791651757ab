"""What travels through the host: frames, and the camera as a promise."""
