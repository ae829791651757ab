"""The structures and request numbers of `linux/videodev2.h` that capture needs, for Linux with 64 bit.

Names are the kernel's without the prefix V4L2_ or VIDIOC_. An ioctl number packs direction, size, the letter V and a
count, so that a structure of a wrong size cannot be passed by mistake: the kernel does not know the number.
"""

import ctypes
from ctypes import Structure, Union, c_char, c_int32, c_long, c_uint8, c_uint32, c_ulong

CAPTURE = 1  # V4L2_BUF_TYPE_VIDEO_CAPTURE
MMAP = 1  # V4L2_MEMORY_MMAP
FIELD_NONE = 1  # V4L2_FIELD_NONE

# Bits of what a device can
CAP_VIDEO_CAPTURE = 0x1
CAP_STREAMING = 0x04000000
CAP_DEVICE_CAPS = 0x80000000

# Bits of V4L2_BUF_FLAG_
FLAG_ERROR = 0x40
TIMESTAMP_MASK, TIMESTAMP_MONOTONIC = 0xE000, 0x2000
SOURCE_MASK, SOURCE_SOE = 0x70000, 0x10000

FRAME_DISCRETE = 1  # of FRMSIZE and FRMIVAL alike

CTRL_DISABLED = 0x1  # V4L2_CTRL_FLAG_DISABLED


def _u32(*names: str) -> tuple[tuple[str, type[c_uint32]], ...]:
    return tuple((name, c_uint32) for name in names)


class Capability(Structure):
    """Answer of QUERYCAP."""

    _fields_ = (
        ("driver", c_char * 16), ("card", c_char * 32), ("bus_info", c_char * 32),
        *_u32("version", "capabilities", "device_caps"), ("reserved", c_uint32 * 3),
    )  # fmt: skip


class FormatDescription(Structure):
    """One entry of ENUM_FMT."""

    _fields_ = (
        *_u32("index", "type", "flags"), ("description", c_char * 32), *_u32("pixelformat", "mbus_code"),
        ("reserved", c_uint32 * 3),
    )  # fmt: skip


class _SizeUnion(Union):
    _fields_ = (("values", c_uint32 * 6),)  # width, height; or min, max, step of width, then of height


class FrameSize(Structure):
    """One entry of ENUM_FRAMESIZES."""

    _fields_ = (*_u32("index", "pixel_format", "type"), ("size", _SizeUnion), ("reserved", c_uint32 * 2))


class FrameInterval(Structure):
    """One entry of ENUM_FRAMEINTERVALS; `values` are fractions of a second: the one, or min, max and step."""

    _fields_ = (
        *_u32("index", "pixel_format", "width", "height", "type"), ("values", c_uint32 * 6), ("reserved", c_uint32 * 2),
    )  # fmt: skip


class PixelFormat(Structure):
    """Single-planar picture format."""

    _fields_ = _u32(
        "width", "height", "pixelformat", "field", "bytesperline", "sizeimage", "colorspace", "priv", "flags",
        "ycbcr_enc", "quantization", "xfer_func",
    )  # fmt: skip


class _FormatUnion(Union):
    # the kernel's union holds pointers too (struct v4l2_window), hence the alignment of one
    _fields_ = (("pix", PixelFormat), ("raw", c_uint8 * 200), ("aligned", c_ulong))


class Format(Structure):
    """Argument of G_FMT and S_FMT."""

    _fields_ = (("type", c_uint32), ("fmt", _FormatUnion))


class StreamParameters(Structure):
    """Argument of G_PARM and S_PARM."""

    _fields_ = (
        *_u32("type", "capability", "capturemode", "numerator", "denominator", "extendedmode", "readbuffers"),
        ("rest", c_uint8 * 176),
    )  # fmt: skip


class RequestBuffers(Structure):
    """Argument of REQBUFS."""

    _fields_ = _u32("count", "type", "memory", "capabilities", "flags")


class _Time(Structure):
    _fields_ = (("seconds", c_long), ("microseconds", c_long))


class _BufferPlace(Union):
    _fields_ = (("offset", c_uint32), ("userptr", c_ulong), ("fd", c_int32))


class Buffer(Structure):
    """Argument of QUERYBUF, QBUF and DQBUF."""

    _fields_ = (
        *_u32("index", "type", "bytesused", "flags", "field"), ("timestamp", _Time), ("timecode", c_uint8 * 16),
        *_u32("sequence", "memory"), ("m", _BufferPlace), *_u32("length", "reserved2"), ("request_fd", c_int32),
    )  # fmt: skip


class Control(Structure):
    """Argument of G_CTRL and S_CTRL."""

    _fields_ = (("id", c_uint32), ("value", c_int32))


class ControlDescription(Structure):
    """Argument of QUERYCTRL."""

    _fields_ = (
        *_u32("id", "type"), ("name", c_char * 32), ("minimum", c_int32), ("maximum", c_int32),
        ("step", c_int32), ("default_value", c_int32), ("flags", c_uint32), ("reserved", c_uint32 * 2),
    )  # fmt: skip


class Int(Structure):
    """The bare int of STREAMON and STREAMOFF."""

    _fields_ = (("value", c_int32),)


_READ, _WRITE = 2, 1  # asm-generic/ioctl.h


def _request(direction: int, number: int, kind: type[Structure]) -> int:
    return direction << 30 | ctypes.sizeof(kind) << 16 | ord("V") << 8 | number


QUERYCAP = _request(_READ, 0, Capability)
ENUM_FMT = _request(_READ | _WRITE, 2, FormatDescription)
G_FMT = _request(_READ | _WRITE, 4, Format)
S_FMT = _request(_READ | _WRITE, 5, Format)
REQBUFS = _request(_READ | _WRITE, 8, RequestBuffers)
QUERYBUF = _request(_READ | _WRITE, 9, Buffer)
QBUF = _request(_READ | _WRITE, 15, Buffer)
DQBUF = _request(_READ | _WRITE, 17, Buffer)
STREAMON = _request(_WRITE, 18, Int)
STREAMOFF = _request(_WRITE, 19, Int)
G_PARM = _request(_READ | _WRITE, 21, StreamParameters)
S_PARM = _request(_READ | _WRITE, 22, StreamParameters)
G_CTRL = _request(_READ | _WRITE, 27, Control)
S_CTRL = _request(_READ | _WRITE, 28, Control)
QUERYCTRL = _request(_READ | _WRITE, 36, ControlDescription)
ENUM_FRAMESIZES = _request(_READ | _WRITE, 74, FrameSize)
ENUM_FRAMEINTERVALS = _request(_READ | _WRITE, 75, FrameInterval)


def fourcc(code: int) -> str:
    """Return the four letters of a pixel format."""
    return code.to_bytes(4, "little").decode("latin-1").rstrip()


def code_of(letters: str) -> int:
    """Return the number of a pixel format of four letters."""
    return int.from_bytes(letters.ljust(4).encode("latin-1"), "little")
