"""What is remembered of one sensor: its calibration bundle."""
