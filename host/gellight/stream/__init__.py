"""Frames for other programs: in this process, in another one, on another computer."""
