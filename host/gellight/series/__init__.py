"""Series of exposures, each under another light, in; depth out.

reconstructor.py      the light of each LED to a tactile frame, by the light model of the ring
single_light_path.py  the frame path of a bundle whose lights are shown one after the other; its GelNet
summary.py            what a series shows as one picture, and whether its scene rested; a series of image files
"""
