"""How a sensor sees: its lens, and the light of each LED, measured.

lens/    the distortion of the lens, with a grid of pins
lights/  where each LED shines on the gel, and the directions of any lights
"""
