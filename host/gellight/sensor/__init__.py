"""The only room with devices: finds them, opens them, sets and lights them.

discovery.py       what is plugged in, and which camera and ring are one sensor
sensor_camera.py   the camera of a real sensor, found again after it was unplugged
connection.py      its camera and ring while they are there
set_and_light.py   sets and lights a sensor, and returns frames that show it
series_cameras.py  cameras that light the ring: series of exposures
window_camera.py   a window that slides over the frames of a light sequence
bandwidth.py       whether the cameras of several sensors fit on their USB buses
opencv_camera.py   the fallback by OpenCV
findings.py        what a check finds, with its remedy
udev.py            the rule that lets a user open the devices
v4l2/              the kernel's cameras
lighting/          which light a frame was taken under
"""
