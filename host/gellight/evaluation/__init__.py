"""Figures about the product, for `bench`: speed as ratios, errors where the truth is known.

bench.py              the frame path against the plain network
analytic_surfaces.py  surfaces whose depth is known by a formula; the integrator on them
synthetic.py          balls pressed into the simulated gel
simulated_presses.py  photometric stereo against GelNet on the same presses
object_errors.py      a bundle on the objects of the paper
"""
