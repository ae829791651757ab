"""Lens distortion: measured with a grid of pins of known pitch, kept in the bundle, taken out of the gradient map.

model.py         where the camera sees a point of the gel
pins.py          a picture to the centres of its pins
lattice.py       centres to rows and columns
fitting.py       rows and columns to the lens, or the reason why not
lens_file.py     `lens.json` of a calibration bundle
undistortion.py  the gradient map of a distorted picture to that of the gel
"""
