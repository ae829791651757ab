"""Why an object is lost."""

from enum import StrEnum


class Loss(StrEnum):
    """Why a frame has no pose of the object."""

    LIFTED = "lifted"
    UNLIKE = "unlike"
    """no motion makes its relief agree with what was seen before"""
    UNTOLD = "untold"
    """it agrees, and may have moved along what its relief does not tell"""
    UNSURE = "unsure"
    """it agrees, and the errors of all frames since the first have grown beyond what may be believed"""
