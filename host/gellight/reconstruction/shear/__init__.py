"""The gel along its surface, from its marker dots.

layer.py    how traction on the gel moves its surface along itself
slip.py     whether what touches slips, by the motion of imprint and dots
felt.py     from the dots of a frame, its depth and its pressure to displacement and force
"""
