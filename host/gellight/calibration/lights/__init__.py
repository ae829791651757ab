"""The light of each LED of a real ring, measured.

taking.py           one picture under every LED
reference_light.py  where its light falls on the gel at rest
ring_fit.py         the geometry of the ring that explains it
adding.py           puts it together and adds it to a bundle
"""
