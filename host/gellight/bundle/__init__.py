"""What is remembered of one sensor: its calibration bundle.

manifest.py     manifest.toml: the sensor, and a hash of every other file; metrics.json
bundle.py       Bundle: a bundle in memory; read, written, extended
bundle_file.py  a JSON file that a bundle may hold beside its own
limits.py       what a bundle must have reached on fresh presses
store.py        the bundles of this user, and which of them is in service
"""
