"""Endurance: simulated hardware with every fault that can be made, the product on it, and the judge of what comes out.

run.py               the soak: faults, recoveries, the report
faults.py            what goes wrong, drawn from a seed
hardware.py          the sensor: kernel.py (V4L2 cameras), usb_tree.py (sysfs and /dev), an emulated board
marks.py             numbers in pictures
shift.py             a daemon with recording and subscriber; reader.py and holder.py are programs to be killed
judging.py           what has to hold; resources.py: memory and handles
"""
