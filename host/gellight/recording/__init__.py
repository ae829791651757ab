"""Recordings: MCAP files that open in ROS 2 tools, and that are a camera again.

ros_messages.py    the messages of ROS 2 that are written, in CDR
frame_record.py    what is recorded of one camera frame
recording_file.py  writing and reading the file
array_files.py     tactile frames in one file of arrays, HDF5
replay_camera.py   the camera of `replay://FILE`
"""
