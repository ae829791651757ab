"""Arrays in, depth out; no device.

stages.py        the names and times of the stages of a frame path, and the frame at its end
gelnet.py        difference image to gradient map, pixel by pixel; which pixels are touched
network_session.py  the network in ONNX Runtime
cast_shadows.py  which LEDs the surface hides from which pixels, and the slopes with their light
light_drift.py   what the light has changed since the reference image
image_noise.py   the noise of a camera, as means over pixels show it
fine_pattern.py  what tells one unit from another
smoothing.py     how wide the gradient map may be smoothed
integration.py   gradient map to depth map and normal map; where the gel is at rest
perspective.py   the same under a camera whose height above the gel is known
errors.py        errors against a true surface
contact.py       where, how large and how deep the gel is touched
following.py     which contact is which from frame to frame, and how it moves
confidence.py    why a pixel is not to be believed
error_bounds.py  by how much nine in ten pixels are off at most
force.py         depth map to force and pressure
force_file.py    its constant, in a bundle
measures.py      what a bundle says of a frame when somebody asks
native/          a room of its own: the frame path in C, for the processors it is built for
lens/            the distortion of a lens, taken out of the gradient map
"""
