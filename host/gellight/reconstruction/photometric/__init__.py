"""Photometric stereo on the sensor: normals from several exposures, each under another light.

directions.py   any lights, a vector for each; recorded.py: a series of image files by them
channel_network.py  GelNet with a channel for each light; channel_path.py: the frame path of such a bundle
the others      the ring of the sensor: the place of each LED
"""
