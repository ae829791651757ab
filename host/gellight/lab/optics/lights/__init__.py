"""The light of each LED of a real ring, measured.

reference_light.py  where its light falls on the gel at rest
ring_fit.py         the geometry of the ring that explains it
ball_series.py      pictures of balls under each light, read or taken; errors on balls that were held out
channel_fit.py      the lights from such pictures, GelNet with a channel for each light, and its bundle
adding.py           takes a picture under every LED, puts it together and adds it to a bundle
"""
