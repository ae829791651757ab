"""The light of each LED of a real ring, measured.

reference_light.py  where its light falls on the gel at rest
ring_fit.py         the geometry of the ring that explains it
ball_series.py      pictures of balls under each light; errors on balls that were held out
ball_lights.py      any lights, from such pictures
live_series.py      such pictures, taken from a sensor with a ring
channel_fit.py      GelNet with a channel for each light, and its bundle
adding.py           takes a picture under every LED, puts it together and adds it to a bundle that a ball confirms
"""
