"""The watch: what has changed about the sensor since it was calibrated, while it streams.

A frame of the untouched gel is compared with the reference image of the bundle on cells of 8 x 8 pixels. What a change
of light or of the camera's place can do to such a picture is known (`light.py`, `untouched_model.py`); what it cannot
do is a touch, dirt or a tear. So touch and fault are distinguished without the depth map, which a fault falsifies.

cells.py            cell means of an image, and back
light.py            where the light of each LED falls, fitted to the reference image
untouched_model.py  light and place fitted to a change; the cells that do not fit
explanation.py      drift, single LEDs or a moved camera: which of them explains the change
other_unit.py       whether it is the unit of the bundle at all
possible.py         whether a depth and a contact can be at all
spots.py            cells that never come to rest while touches come and go: dirt, a tear
expected.py         what the change costs in degrees and millimetres
findings.py         what has changed, in words and figures
monitor.py          the object that is fed with frames
"""
