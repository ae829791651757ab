"""A lens measured with a grid of pins of known pitch.

pins.py       a picture to the centres of its pins
lattice.py    centres to rows and columns
lens_fit.py   rows and columns to the lens, or the reason why not
measuring.py  pictures to `lens.json` of a bundle
"""
