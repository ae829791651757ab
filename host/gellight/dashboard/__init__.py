"""The dashboard: a page that shows what the sensor feels, live, and lets a visitor press; `access.py`: to whom."""
