"""Photometric stereo: where light comes from, and slopes from pictures under several lights. Arrays in, slopes out.

ring_geometry.py  the places of the LEDs of a ring
light_model.py    the light of each LED, and how pictures are taken apart into it
lights_file.py    `lights.json` of a bundle, which holds that
solver.py         slopes from the light of LEDs whose places are known; how high the gel stands as a whole
directions.py     slopes under any lights, a vector for each
static_scene.py   whether the scene rested
"""
