"""How depth is recorded, apart from the file: who chooses it needs neither NumPy nor MCAP."""

from enum import StrEnum


class DepthKind(StrEnum):
    """How depth is recorded; it can be computed again from the pictures in any case."""

    NONE = "none"
    FLOAT32 = "float32"
    UINT16 = "uint16"
