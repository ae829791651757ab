"""The watch: what has changed about the sensor since it was calibrated, while it streams.

A frame of the untouched gel is compared with the reference image of the bundle on cells of 8 x 8 pixels. What a change
of light or of the camera's place can do to such a picture is known (`light.py`, `untouched_model.py`); what it cannot
do is a touch, dirt or a tear. So touch and fault are distinguished without the depth map, which a fault falsifies.
"""
