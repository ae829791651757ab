"""Arrays in, depth out; no device."""
