"""What turns depth into newtons, from known weights or a load cell.

indented.py  the CSV file of forces, and what the sensor felt under each of them
fit.py       the modulus that explains them, and its error; for forces along a gel with marker dots too
"""
