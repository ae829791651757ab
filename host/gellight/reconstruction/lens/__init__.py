"""Lens distortion, taken out of the gradient map.

model.py         where the camera sees a point of the gel
undistortion.py  the gradient map of a distorted picture to that of the gel; `lens.json` of a bundle
"""
