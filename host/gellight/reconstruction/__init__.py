"""Arrays in, depth out; no device.

pipeline.py      Reconstructor: the way from a camera frame to a tactile frame
gelnet.py        the network in ONNX Runtime: difference image to gradient map
pixel_grid.py    where pixels lie on the gel; means over blocks of them
light_drift.py   what the light has changed since the reference image
image_noise.py   the noise of a camera, as means over pixels show it
smoothing.py     how wide the gradient map may be smoothed
integration.py   gradient map to depth map and normal map
errors.py        errors against a true surface
contact.py       where, how large and how deep the gel is touched
lens/            the distortion of a lens, taken out of the gradient map
photometric/     slopes measured from several exposures instead of learnt
"""
