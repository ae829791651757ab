"""The gel along its surface, from its marker dots.

layer.py    how traction on the gel moves its surface along itself
inverse.py  the traction that moves the dots as they have moved
felt.py     from the dots of a frame, its depth and its pressure to displacement and force
"""
