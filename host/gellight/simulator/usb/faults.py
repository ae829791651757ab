"""Faults that a virtual sensor makes on purpose, to test programs that have to notice them."""

import math
from dataclasses import dataclass, fields, replace

from gellight.base.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Faults:
    """The faults of a virtual sensor; by default it has none."""

    drop: float = 0.0
    """share of the frames that the camera loses without a word"""
    error: float = 0.0
    """share of the frames that the camera itself marks as damaged"""
    torn: float = 0.0
    """share of the frames of which only the beginning is sent"""
    duplicate: float = 0.0
    """share of the frames that are sent a second time instead of the next one"""
    late_ms: float = 0.0
    """each frame is held back, up to so long, before it is sent: the kernel's time stamp is wrong by as much"""
    stall_after: int = 0
    """so many frames after the start of a stream the camera falls silent; 0: never"""
    unplug_after: int = 0
    """so many frames after the start of a stream the cable is pulled; 0: never"""
    stuck: str = ""
    """name of a control (exposure_us, gain, white_balance_k, ...) that takes a new value and does not keep it"""

    def __post_init__(self) -> None:
        """Refuse shares outside 0..1 and times and counts below 0 or without end."""
        for name in ("drop", "error", "torn", "duplicate"):
            if not 0 <= getattr(self, name) <= 1:
                raise InputError(f"fault {name}={getattr(self, name)}: give the share of the frames, 0 to 1")
        for name in ("late_ms", "stall_after", "unplug_after"):
            if not 0 <= getattr(self, name) < math.inf:
                raise InputError(f"fault {name}={getattr(self, name)}: give a number from 0 up")


NO_FAULTS = Faults()


def parse_faults(texts: list[str]) -> Faults:
    """Return the faults that texts such as `drop=0.1` or `stuck=exposure_us` name; InputError for what names none."""
    known = {field.name: type(getattr(Faults(), field.name)) for field in fields(Faults)}
    faults = Faults()
    for text in texts:
        name, _, value = text.partition("=")
        if name not in known:
            raise InputError(f"fault {name!r} is not known: choose one of {', '.join(known)}")
        try:
            faults = replace(faults, **{name: known[name](value)})
        except ValueError:
            example = "a whole number, for example {}=10" if known[name] is int else "a number, for example {}=0.1"
            raise InputError(f"fault {text!r}: give {example.format(name)}") from None
    return faults
