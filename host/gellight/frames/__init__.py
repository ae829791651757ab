"""What travels through the host: frames, and the camera as a promise.

frames.py       CameraFrame, TactileFrame, Contact
camera.py       what every camera promises
timing.py       when a camera exposes its rows
series.py       several exposures of one scene
judging.py      how a frame is judged where the truth is known
image_files.py  image files as a camera
"""
