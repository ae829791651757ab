"""Reference simulator of a camera-based tactile sensor: NumPy and SciPy, pure functions, plain rather than fast."""
