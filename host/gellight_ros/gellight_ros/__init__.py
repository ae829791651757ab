"""A sensor that runs, in ROS 2 and in Foxglove; the entry points `gellight.bridges` name both ways.

ros_topics.py  the topics, and how the message of each is made of a tactile frame
ros2.py        topics by zenoh, as ROS 2's rmw_zenoh has them
foxglove.py    the same by WebSocket
"""
