"""The light of each LED of a real ring, measured.

reference_light.py  where its light falls on the gel at rest
ring_fit.py         the geometry of the ring that explains it
ball_lights.py      any lights, from recorded pictures of balls
ball_check.py       whether the fitted ring is right, by a ball
adding.py           takes a picture under every LED, puts it together and adds it to a bundle
"""
