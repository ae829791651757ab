"""GelLight's host: from camera frames to tactile depth in real time."""
