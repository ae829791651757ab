"""The only room with devices: finds them, opens them, sets and lights them."""
