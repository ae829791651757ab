"""What travels through the host: frames, and the camera as a promise.

frames.py          CameraFrame, ExposureSeries, TactileFrame, Contact; how a frame is judged where the truth is known
measures.py        what is computed of a tactile frame when somebody asks: force, confidence
camera.py          what every camera promises, and when it exposes its rows
camera_wrapper.py  the base of cameras that stand in front of another
image_files.py     image files as a camera
view.py            perspective and crop
dots.py            marker dots, found and filled
dot_places.py      where their middles are
dot_following.py   which dot is which from frame to frame
shear.py           what is known of the gel along its surface; the same as figures that travel
picture.py         what a bundle does to each picture, and the camera that does it
pixel_grid.py      where pixels lie on the gel; means over blocks of them
maps_file.py       the maps of a frame as one .npz file
over_gel.py        maps of the picture, laid over the gel
point_cloud.py     a depth map as points in space; normals
video_files.py     the pictures of a video file
"""
