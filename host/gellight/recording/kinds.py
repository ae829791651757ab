"""What recordings hold and become, apart from the files: who chooses it needs neither NumPy nor MCAP."""

from enum import StrEnum


class DepthKind(StrEnum):
    """How depth is recorded; it can be computed again from the pictures in any case."""

    NONE = "none"
    FLOAT32 = "float32"
    UINT16 = "uint16"


class Kind(StrEnum):
    """What a recording is turned into."""

    NPZ = "npz"
    PNG = "png"
    PLY = "ply"
    VIDEO = "video"
    HDF5 = "hdf5"
    LEROBOT = "lerobot"


ONE_FILE = {Kind.HDF5: "frames.h5", Kind.LEROBOT: "lerobot"}
