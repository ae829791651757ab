"""What is remembered of one sensor: its calibration bundle.

manifest.py     manifest.toml: the sensor, and a hash of every other file
bundle.py       Calibration: a bundle in memory; read, written, extended
bundle_file.py  a JSON file that a bundle may hold beside its own
store.py        the bundles of this user, and which of them is in service
"""
