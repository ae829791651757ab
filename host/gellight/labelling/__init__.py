"""Circles without clicks: where a ball touches the gel, found in the picture of a press alone."""

from gellight.labelling.circle import PressCircle, find_circle

__all__ = ["PressCircle", "find_circle"]
