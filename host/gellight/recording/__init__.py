"""Recordings: MCAP files that open in ROS 2 tools, and that are a camera again."""
