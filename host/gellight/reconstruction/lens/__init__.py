"""Lens distortion, taken out of the gradient map.

model.py         where the camera sees a point of the gel
intrinsics.py    the same as a pinhole camera, as other programs have it
lens_file.py     `lens.json` of a calibration bundle
undistortion.py  the gradient map of a distorted picture to that of the gel
"""
