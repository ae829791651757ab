"""What turns depth into newtons, from known weights or a load cell.

record.py    the CSV file of forces
indented.py  what the sensor felt under each of them
fit.py       the modulus that explains them, and its error; all of it, into a bundle
sideways.py  the constant of forces along a gel with marker dots
"""
