"""The messages of ROS 2 that recordings and topics are made of, in CDR (little-endian, XCDR version 1)."""

import struct
from dataclasses import dataclass
from typing import Self

_ENCAPSULATION = b"\x00\x01\x00\x00"
_SEPARATOR = "=" * 80

IMAGE, COMPRESSED_IMAGE, STRING = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage", "std_msgs/msg/String"
CAMERA_INFO, POINTS = "sensor_msgs/msg/CameraInfo", "sensor_msgs/msg/PointCloud2"
POINT, WRENCH = "geometry_msgs/msg/PointStamped", "geometry_msgs/msg/WrenchStamped"
POSE = "geometry_msgs/msg/PoseWithCovarianceStamped"
TF = "tf2_msgs/msg/TFMessage"
MULTI_ARRAY = "std_msgs/msg/Float64MultiArray"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"


def _definition(fields: str, **parts: str) -> str:
    """Return the definition of a type and of the `parts` it is made of, named with _ for /; fields: one a line.

    Header and time are added where there is a header.
    """
    if any("std_msgs/Header header" in text for text in (fields, *parts.values())):
        parts |= {
            "std_msgs_Header": "builtin_interfaces/Time stamp; string frame_id",
            "builtin_interfaces_Time": "int32 sec; uint32 nanosec",
        }
    named = [f"{_SEPARATOR}\nMSG: {'/'.join(name.rsplit('_', 1))}\n{text}" for name, text in parts.items()]
    return "\n".join([fields, *named]).replace("; ", "\n") + "\n"


_HEADER = "std_msgs/Header header; "
DEFINITIONS = {
    IMAGE: _definition(
        _HEADER + "uint32 height; uint32 width; string encoding; uint8 is_bigendian; uint32 step; uint8[] data"
    ),
    COMPRESSED_IMAGE: _definition(_HEADER + "string format; uint8[] data"),
    STRING: _definition("string data"),
    CAMERA_INFO: _definition(
        _HEADER + "uint32 height; uint32 width; string distortion_model; float64[] d; float64[9] k; float64[9] r; "
        "float64[12] p; uint32 binning_x; uint32 binning_y; sensor_msgs/RegionOfInterest roi",
        sensor_msgs_RegionOfInterest="uint32 x_offset; uint32 y_offset; uint32 height; uint32 width; bool do_rectify",
    ),
    POINTS: _definition(
        _HEADER + "uint32 height; uint32 width; sensor_msgs/PointField[] fields; bool is_bigendian; "
        "uint32 point_step; uint32 row_step; uint8[] data; bool is_dense",
        sensor_msgs_PointField="string name; uint32 offset; uint8 datatype; uint32 count",
    ),
    POINT: _definition(_HEADER + "geometry_msgs/Point point", geometry_msgs_Point="float64 x; float64 y; float64 z"),
    WRENCH: _definition(
        _HEADER + "geometry_msgs/Wrench wrench",
        geometry_msgs_Wrench="geometry_msgs/Vector3 force; geometry_msgs/Vector3 torque",
        geometry_msgs_Vector3="float64 x; float64 y; float64 z",
    ),
    POSE: _definition(
        _HEADER + "geometry_msgs/PoseWithCovariance pose",
        geometry_msgs_PoseWithCovariance="geometry_msgs/Pose pose; float64[36] covariance",
        geometry_msgs_Pose="geometry_msgs/Point position; geometry_msgs/Quaternion orientation",
        geometry_msgs_Point="float64 x; float64 y; float64 z",
        geometry_msgs_Quaternion="float64 x 0; float64 y 0; float64 z 0; float64 w 1",
    ),
    TF: _definition(
        "geometry_msgs/TransformStamped[] transforms",
        geometry_msgs_TransformStamped=_HEADER + "string child_frame_id; geometry_msgs/Transform transform",
        geometry_msgs_Transform="geometry_msgs/Vector3 translation; geometry_msgs/Quaternion rotation",
        geometry_msgs_Vector3="float64 x; float64 y; float64 z",
        geometry_msgs_Quaternion="float64 x 0; float64 y 0; float64 z 0; float64 w 1",
    ),
    MULTI_ARRAY: _definition(
        "std_msgs/MultiArrayLayout layout; float64[] data",
        std_msgs_MultiArrayLayout="std_msgs/MultiArrayDimension[] dim; uint32 data_offset",
        std_msgs_MultiArrayDimension="string label; uint32 size; uint32 stride",
    ),
    DIAGNOSTICS: _definition(
        _HEADER + "diagnostic_msgs/DiagnosticStatus[] status",
        diagnostic_msgs_DiagnosticStatus="byte level; string name; string message; string hardware_id; "
        "diagnostic_msgs/KeyValue[] values",
        diagnostic_msgs_KeyValue="string key; string value",
    ),
}
"""of each type, as ROS 2 writes them into a bag"""
HASHES = {
    IMAGE: "RIHS01_d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47",
    CAMERA_INFO: "RIHS01_b3dfd68ff46c9d56c80fd3bd4ed22c7a4ddce8c8348f2f59c299e73118e7e275",
    POINTS: "RIHS01_9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5",
    POINT: "RIHS01_4c0296af86e01e562e9e0405d138a01537247580076c58ea38d7923ac1045897",
    WRENCH: "RIHS01_8dc3deaf06b2ab281f9f9a742a8961c328ca7cec16e3fd6586d3a5c83fa78f77",
    POSE: "RIHS01_26432f9803e43727d3c8f668d1fdb3c630f548af631e2f4e31382371bfea3b6e",
    TF: "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
    MULTI_ARRAY: "RIHS01_1025ddc6b9552d191f89ef1a8d2f60f3d373e28b283d8891ddcc974e8c55397f",
    DIAGNOSTICS: "RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
}
"""of the types that are topics (REP 2011), of Jazzy and later: who subscribes to another definition gets nothing"""


class CdrWriter:
    """Puts values one after the other, each aligned to its size."""

    def __init__(self) -> None:
        """Begin a message."""
        self._content = bytearray(_ENCAPSULATION)

    def put(self, kind: str, *values: float) -> Self:
        """Add numbers of one `struct` type such as I (uint32)."""
        size = struct.calcsize(f"<{kind}")
        for value in values:
            self._content += bytes(-(len(self._content) - 4) % size) + struct.pack(f"<{kind}", value)
        return self

    def string(self, text: str) -> Self:
        """Add a text."""
        content = text.encode() + b"\0"
        self.put("I", len(content))
        self._content += content
        return self

    def blob(self, content: bytes) -> Self:
        """Add a sequence of bytes."""
        self.put("I", len(content))
        self._content += content
        return self

    def header(self, unix_s: float, frame_id: str) -> Self:
        """Add std_msgs/Header."""
        stamp_ns = round(unix_s * 1e9)
        return self.put("i", stamp_ns // 10**9).put("I", stamp_ns % 10**9).string(frame_id)

    def finish(self) -> bytes:
        """Return the message."""
        return bytes(self._content)


class CdrReader:
    """Takes values out of a message; ValueError where it is too short."""

    def __init__(self, content: bytes) -> None:
        """Begin behind the encapsulation, which has to say little-endian."""
        if content[:2] != _ENCAPSULATION[:2]:
            raise ValueError("the message is not CDR in little-endian order")
        self._content, self._at = memoryview(content), 4

    def take(self, kind: str) -> int:
        """Take a whole number of one `struct` type."""
        size = struct.calcsize(f"<{kind}")
        self._at += -(self._at - 4) % size
        return int(struct.unpack(f"<{kind}", self._piece(size))[0])

    def string(self) -> str:
        """Take a text."""
        return bytes(self._piece(self.take("I"))).rstrip(b"\0").decode()

    def blob(self) -> bytes:
        """Take a sequence of bytes."""
        return bytes(self._piece(self.take("I")))

    def header(self) -> None:
        """Pass over std_msgs/Header."""
        self.take("i")
        self.take("I")
        self.string()

    def _piece(self, size: int) -> memoryview:
        piece = self._content[self._at : self._at + size]
        if len(piece) < size:
            raise ValueError("the message is cut off")
        self._at += size
        return piece


@dataclass(frozen=True, kw_only=True)
class RosImage:
    """sensor_msgs/Image without its header."""

    height: int
    width: int
    encoding: str
    """of ROS: rgb8, mono8, yuv422_yuy2, 32FC1 (metres), 16UC1"""
    step: int
    """bytes of a line"""
    data: bytes

    def encode(self, unix_s: float, frame_id: str) -> bytes:
        """Return the message."""
        writer = CdrWriter().header(unix_s, frame_id).put("I", self.height, self.width).string(self.encoding)
        return writer.put("B", 0).put("I", self.step).blob(self.data).finish()

    @classmethod
    def decode(cls, content: bytes) -> Self:
        """Read a message; ValueError where it is damaged."""
        reader = CdrReader(content)
        reader.header()
        height, width, encoding = reader.take("I"), reader.take("I"), reader.string()
        reader.take("B")
        return cls(height=height, width=width, encoding=encoding, step=reader.take("I"), data=reader.blob())


def encode_compressed(data: bytes, unix_s: float, frame_id: str, kind: str) -> bytes:
    """Return sensor_msgs/CompressedImage; kind: jpeg or png."""
    return CdrWriter().header(unix_s, frame_id).string(kind).blob(data).finish()


def decode_compressed(content: bytes) -> bytes:
    """Return the picture of sensor_msgs/CompressedImage; ValueError where it is damaged."""
    reader = CdrReader(content)
    reader.header()
    reader.string()
    return reader.blob()


def encode_string(text: str) -> bytes:
    """Return std_msgs/String."""
    return CdrWriter().string(text).finish()


def decode_string(content: bytes) -> str:
    """Return the text of std_msgs/String; ValueError where it is damaged."""
    return CdrReader(content).string()
