"""Figures about the product (speed as ratios, errors against a truth), and data sets of simulated presses.

frame_bench.py        the time of the frame path, against the network alone and the peak of the processor
bench.py              the depth scale of the integrator
analytic_surfaces.py  surfaces whose depth is known by a formula; the integrator on them
synthetic.py          the bundle of the simulated sensor; balls pressed into it
simulated_presses.py  photometric stereo against GelNet on the same presses
demo_presses.py       the presses of the demo, computed ahead by finite elements
dataset.py            many presses as files, for training other networks
checked_presses.py    presses compared with the reference simulator
object_errors.py      a bundle on the objects of the paper
"""
