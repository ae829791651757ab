"""What a recording is turned into, apart from what writes it."""

from enum import StrEnum


class Kind(StrEnum):
    """What a recording is turned into."""

    NPZ = "npz"
    PNG = "png"
    PLY = "ply"
    VIDEO = "video"
    HDF5 = "hdf5"
    LEROBOT = "lerobot"


ONE_FILE = {Kind.HDF5: "frames.h5", Kind.LEROBOT: "lerobot"}
