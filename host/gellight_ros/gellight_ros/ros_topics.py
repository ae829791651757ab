"""What a sensor says in messages of ROS 2: the topics, their types, and how each is made of a tactile frame.

docs/streaming.md has them in a table, with what they hold: frames, units, what is NaN or left out. ros2.py sends them
by zenoh, foxglove.py by WebSocket.
"""

import time
from collections.abc import Callable
from math import nan

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gellight.daemon.session import SensorSession
from gellight.frames.frames import Patch, TactileFrame
from gellight.frames.measures import Force
from gellight.frames.point_cloud import points_of
from gellight.frames.pose import ObjectPose
from gellight.frames.shear import Shear
from gellight.photometric.ring_geometry import RingGeometry
from gellight.recording.kinds import DepthKind
from gellight.recording.recording_file import depth_image
from gellight.recording.ros_messages import IMAGE, CdrWriter, RosImage
from gellight_ros.intrinsics import intrinsics
from gellight_ros.ros_types import CAMERA_INFO, MULTI_ARRAY, POINT, POINTS, POSE, TF, WRENCH

DIAGNOSTICS_TOPIC = "/diagnostics"
DIAGNOSTICS_S = 1.0
"""between two messages of diagnostics"""
FLOAT32 = 7
"""of sensor_msgs/PointField"""
UINT32 = 6
OF_CONTACTS = np.dtype(
    [(name, "<f4") for name in ("x", "y", "z")]
    + [("number", "<u4")]
    + [(name, "<f4") for name in ("area", "volume", "slope", "velocity_x", "velocity_y", "age")]
)
"""of a contact: its centroid with its depth as z, m; then `frames.Patch` in m2, m3, rad, m/s, s; y is up"""
Encode = Callable[[TactileFrame], bytes | None]
"""makes the message of a frame; None where the frame has nothing to say of it"""


class RosTopics:
    """The messages of one daemon."""

    def __init__(self, daemon: SensorSession, name: str, distance_mm: float = RingGeometry.camera_height_mm) -> None:
        """Describe `daemon`; name: of the sensor, as ROS allows it, for the names of coordinate frames.

        distance_mm: from the gel to the camera, which the focal length of `camera_info` goes by.
        """
        self._daemon, self._name, self._distance_mm = daemon, name, distance_mm
        self.of_frames: dict[str, tuple[str, Encode]] = {
            "image_raw": (IMAGE, self._image),
            "camera_info": (CAMERA_INFO, self._camera_info),
            "depth/image": (IMAGE, self._depth),
            "points": (POINTS, self._points),
            "contact": (POINT, self._contact),
            "contact/wrench": (WRENCH, self._wrench),
            "contact/wrench_covariance": (MULTI_ARRAY, self._wrench_covariance),
            "contacts": (POINTS, self._contacts),
            "object/pose": (POSE, self._pose),
            "/tf": (TF, self._transform),
        }
        """type and encoder by topic; a name with / in front belongs to all sensors, see `topic_of`"""

    def _image(self, frame: TactileFrame) -> bytes:
        image = frame.camera_frame.image
        height, width, _ = image.shape
        sent = RosImage(height=height, width=width, encoding="rgb8", step=3 * width, data=image.tobytes())
        return sent.encode(taken_s(frame), f"{self._name}_camera")

    def _depth(self, frame: TactileFrame) -> bytes:
        return depth_image(frame.depth_mm, DepthKind.FLOAT32).encode(taken_s(frame), f"{self._name}_camera")

    def _camera_info(self, frame: TactileFrame) -> bytes:
        height, width = frame.depth_mm.shape
        writer = CdrWriter().header(taken_s(frame), f"{self._name}_camera").put("I", height, width)
        camera = intrinsics(self._daemon.bundle, self._distance_mm)
        matrix = camera.matrix.ravel().tolist()
        writer.string("plumb_bob").put("I", 5).put("d", *camera.distortion, 0.0, 0.0, 0.0)
        projected = np.column_stack([camera.matrix, np.zeros(3)]).ravel().tolist()
        writer.put("d", *matrix, *np.eye(3).ravel().tolist(), *projected)
        return writer.put("I", *[0] * 6).put("B", 0).finish()

    def _points(self, frame: TactileFrame) -> bytes:
        assert frame.provenance is not None
        seen = frame.provenance.pixel_size_mm, frame.provenance.camera_height_mm
        points = points_of(frame.depth_mm, *seen) * np.float32(1e-3)
        height, width, _ = points.shape
        return self._cloud(frame, (height, width), np.dtype([(name, "<f4") for name in "xyz"]), points.tobytes())

    def _contacts(self, frame: TactileFrame) -> bytes:
        rows = [_row(patch) for patch in frame.contacts]
        return self._cloud(frame, (1, len(rows)), OF_CONTACTS, np.array(rows, OF_CONTACTS).tobytes())

    def _cloud(self, frame: TactileFrame, shape: tuple[int, int], of_point: np.dtype[np.void], content: bytes) -> bytes:
        """Return (height, width) points with the 4-byte fields of `of_point`."""
        writer = CdrWriter().header(taken_s(frame), f"{self._name}_gel").put("I", *shape, len(of_point.names or ()))
        for name, (kind, offset, *_) in (of_point.fields or {}).items():
            writer.string(name).put("I", offset).put("B", UINT32 if kind.kind == "u" else FLOAT32).put("I", 1)
        size = of_point.itemsize
        return writer.put("B", 0).put("I", size, size * shape[1]).blob(content).put("B", 1).finish()

    def _contact(self, frame: TactileFrame) -> bytes:
        x_mm, y_mm = frame.contact.centroid_mm or (nan, nan)
        place_m = x_mm * 1e-3, -y_mm * 1e-3, frame.contact.indentation_mm * 1e-3
        return CdrWriter().header(taken_s(frame), f"{self._name}_gel").put("d", *place_m).finish()

    def _wrench(self, frame: TactileFrame) -> bytes | None:
        if frame.force is None:
            return None
        wrench = (0, 0, frame.force.normal_n, 0, 0, 0) if frame.shear is None else wrench_of(frame.force, frame.shear)
        return CdrWriter().header(taken_s(frame), f"{self._name}_gel").put("d", *wrench).finish()

    def _wrench_covariance(self, frame: TactileFrame) -> bytes | None:
        if frame.force is None or frame.shear is None:
            return None
        writer = CdrWriter().put("I", 2)
        for label, stride in (("row", 36), ("column", 6)):
            writer.string(label).put("I", 6, stride)
        values = covariance_of(frame.force, frame.shear).ravel().tolist()
        return writer.put("I", 0, len(values)).put("d", *values).finish()

    def _pose(self, frame: TactileFrame) -> bytes | None:
        pose = frame.pose
        if pose is None or pose.lost:
            return None
        # The gel's axes of ROS have y up: turned by F = diag(1, -1, 1), F R F is a rotation again, and a turn, which is
        # an axial vector, is turned by -F. Lengths become metres.
        mirror = np.diag([1.0, -1.0, 1.0])
        turned = np.kron(np.diag([1e-3, -1.0]), mirror)
        covariance = turned @ pose.covariance_at(pose.place_mm) @ turned.T
        writer = CdrWriter().header(taken_s(frame), f"{self._name}_gel").put("d", *place_and_turn(pose))
        return writer.put("d", *covariance.ravel().tolist()).finish()

    def _transform(self, frame: TactileFrame) -> bytes | None:
        if frame.pose is None or frame.pose.lost:
            return None
        writer = CdrWriter().put("I", 1).header(taken_s(frame), f"{self._name}_gel").string(f"{self._name}_object")
        return writer.put("d", *place_and_turn(frame.pose)).finish()

    def diagnostics(self) -> bytes:
        """Return the status as a DiagnosticArray: level 2 for an error, 1 for findings of the watch."""
        status = self._daemon.status()
        watch = self._daemon.watch
        findings = [finding.text for finding in watch.findings()] if watch else []
        error = status["error"] or ""
        values = {name: str(status[name]) for name in ("fps", "frames", "lost", "dropped", "mode")}
        writer = CdrWriter().header(time.time(), "").put("I", 1).put("B", 2 if error else 1 if findings else 0)
        writer.string(f"gellight: {self._name}").string(error or "; ".join(findings) or "ok").string(self._name)
        writer.put("I", len(values))
        for name, value in values.items():
            writer.string(name).string(value)
        return writer.finish()


def topic_of(prefix: str, name: str) -> str:
    """Return the topic that a name in `RosTopics.of_frames` stands for."""
    return name if name.startswith("/") else f"{prefix}/{name}"


def place_and_turn(pose: ObjectPose) -> tuple[float, ...]:
    """Return where an object is, m, and its turn as a quaternion x, y, z, w, in a right-handed frame whose y is up."""
    mirror = np.diag([1.0, -1.0, 1.0])
    turn = Rotation.from_matrix(mirror @ pose.motion[:3, :3] @ mirror).as_quat()
    return *(mirror @ pose.place_mm * 1e-3).tolist(), *turn.tolist()


def _row(patch: Patch) -> tuple[float, ...]:
    (x_mm, y_mm), (right, down) = patch.centroid_mm, patch.velocity_mm_s or (nan, nan)
    place_m, speed_m_s = (x_mm * 1e-3, -y_mm * 1e-3, patch.depth_mm * 1e-3), (right * 1e-3, -down * 1e-3)
    sizes = patch.area_mm2 * 1e-6, patch.volume_mm3 * 1e-9, patch.slope_rad
    return *place_m, patch.number, *sizes, *speed_m_s, patch.age_s


def wrench_of(force: Force, shear: Shear) -> tuple[float, ...]:
    """Return force, N, and torque about the middle of the image, N m, in a frame whose y is up; NaN if unknown."""
    known = np.array([*(shear.force_n or (nan, nan)), nan if shear.torque_nmm is None else shear.torque_nmm])
    arm = _arm(shear)
    parts = np.where(
        arm != 0, arm * [*known[:2], force.normal_n, known[2]], 0
    )  # what is unknown spoils its own rows alone
    return tuple(parts.sum(axis=1).tolist())


def covariance_of(force: Force, shear: Shear) -> NDArray[np.float64]:
    """Return the (6, 6) covariance of `wrench_of`; errors of the parts are taken for independent."""
    errors = *(shear.force_error_n or (nan, nan)), force.error_n, shear.torque_error_nmm
    spread = np.array([nan if one is None else one for one in errors], np.float64)
    arm = _arm(shear)
    covariance = (arm * np.nan_to_num(spread) ** 2) @ arm.T
    unknown = (arm[:, np.isnan(spread)] != 0).any(axis=1)
    covariance[unknown | unknown[:, None]] = nan
    return np.asarray(covariance)


def _arm(shear: Shear) -> NDArray[np.float64]:
    """(6, 4) what makes a wrench of x, y (down), normal force and torque about the centre of the pressure, N mm."""
    x, down = shear.centre_mm or (0.0, 0.0)
    torques = [[0, 0, -down, 0], [0, 0, -x, 0], [down, -x, 0, -1]]
    return np.array([[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 1, 0], *(np.array(torques) * 1e-3)], np.float64)


def taken_s(frame: TactileFrame) -> float:
    """Return when the exposure began, Unix time."""
    assert frame.provenance is not None
    return frame.provenance.unix_s
