"""Frames for other programs: in this process, in another one, on another computer.

source.py         FrameSource: what every program reads frames from
sensor.py         connect: a sensor in this process
subscription.py   subscribe: a daemon in another process
publisher.py      Publisher: what makes a daemon's frames available to others
wire.py           the message that carries a frame; docs/wire-format.md
network.py        sessions of zenoh, and its keys
shared_memory.py  frames that need not go through the network
frame_thread.py   the thread that sends a daemon's newest frame
ros_topics.py     topics of ROS 2: their types, and how each is made of a frame
ros2.py           Ros2Publisher: those topics by zenoh, without ROS
foxglove.py       FoxgloveServer: those topics by WebSocket, for Foxglove
recorder.py       Recorder: a daemon's frames in a file
running.py        which daemons of this user publish on this computer
"""
