"""The dashboard: a page on this machine that shows what the sensor feels, live, and lets a visitor press."""
