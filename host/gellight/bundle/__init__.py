"""What is remembered of one sensor: its calibration bundle.

manifest.py     manifest.toml: the sensor, and a hash of every other file
bundle.py       Bundle: a bundle in memory; read, written, extended
bundle_file.py  a JSON file that a bundle may hold beside its own
limits.py       what a bundle must have reached on fresh presses
placeholder.py  the placeholder for the bundle of a sensor that was never calibrated
store.py        the bundles of this user, and which of them is in service
"""
