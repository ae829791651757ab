"""Photometric stereo on the sensor: normals from several exposures, each under another light.

directions.py   any lights, a vector for each; recorded.py: a series of image files by them
the others      the ring of the sensor: the place of each LED
"""
