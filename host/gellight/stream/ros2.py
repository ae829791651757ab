"""Topics of ROS 2 without ROS: the messages and the keys of rmw_zenoh, by the router that ROS 2 runs (`rmw_zenohd`).

    /NAME/image_raw     sensor_msgs/Image          rgb8, frame NAME_camera
    /NAME/camera_info   sensor_msgs/CameraInfo     plumb_bob; see reconstruction/lens/intrinsics.py
    /NAME/depth/image   sensor_msgs/Image          32FC1, metres, positive into the sensor
    /NAME/points        sensor_msgs/PointCloud2    metres, frame NAME_gel: x right, y up, z towards the camera
    /NAME/contact       geometry_msgs/PointStamped metres, frame NAME_gel: centre and indentation; NaN without contact
    /diagnostics        diagnostic_msgs/DiagnosticArray, once a second

A topic that nobody subscribes to costs nothing. The types' hashes are those of Jazzy and later.
"""

import logging
import struct
import threading
import time
import uuid
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from math import nan
from typing import Any, Self

import numpy as np
import zenoh

from gellight.daemon.daemon import Daemon
from gellight.frames.frames import TactileFrame
from gellight.reconstruction.lens.intrinsics import intrinsics
from gellight.reconstruction.photometric.ring_geometry import RingGeometry
from gellight.recording.recording_file import DepthKind, depth_image, topic_name
from gellight.recording.ros_messages import IMAGE, CdrWriter, RosImage
from gellight.report.point_cloud import points_of
from gellight.stream.network import close, subscribing_session

PAPER = RingGeometry()
logger = logging.getLogger(__name__)
POLL_S, DIAGNOSTICS_S = 0.5, 1.0
QOS = "::,1:,:,:,,"
"""reliable, volatile, the last one: as rmw_zenoh writes it, where empty stands for the default"""
CAMERA_INFO, POINTS = "sensor_msgs/msg/CameraInfo", "sensor_msgs/msg/PointCloud2"
POINT, DIAGNOSTICS = "geometry_msgs/msg/PointStamped", "diagnostic_msgs/msg/DiagnosticArray"
HASHES = {
    IMAGE: "RIHS01_d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47",
    CAMERA_INFO: "RIHS01_b3dfd68ff46c9d56c80fd3bd4ed22c7a4ddce8c8348f2f59c299e73118e7e275",
    POINTS: "RIHS01_9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5",
    POINT: "RIHS01_4c0296af86e01e562e9e0405d138a01537247580076c58ea38d7923ac1045897",
    DIAGNOSTICS: "RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
}
"""of the types (REP 2011): who subscribes to another definition gets nothing"""
FLOAT32 = 7
"""of sensor_msgs/PointField"""
Encode = Callable[[TactileFrame], bytes]


@dataclass(frozen=True)
class Topic:
    """A topic that is declared."""

    publisher: zenoh.Publisher
    tokens: tuple[zenoh.LivelinessToken, ...]
    encode: Encode | None
    gid: bytes
    """of the publisher, 16 bytes"""

    @property
    def wanted(self) -> bool:
        """Whether somebody subscribes."""
        status: Any = self.publisher.matching_status  # zenoh annotates it as a bool, which it is not
        return bool(status.matching)


class Ros2Publisher:
    """Publishes a daemon that runs as a node of ROS 2; a context manager."""

    def __init__(
        self, daemon: Daemon, router: str, *, name: str, domain: int = 0, distance_mm: float = PAPER.camera_height_mm
    ) -> None:
        """Publish by the router at `router`, such as tcp/localhost:7447. name: of the sensor. domain: ROS_DOMAIN_ID.

        distance_mm: from the gel to the camera, which the focal length of `camera_info` goes by.
        """
        self._daemon, self._router, self._domain = daemon, router, domain
        self._distance_mm = distance_mm
        self._name = topic_name(name)
        self.prefix = f"/{self._name}"
        self._ended = threading.Event()
        self._count = 0
        self._until = ExitStack()

    def __enter__(self) -> Self:
        """Connect, declare node and topics and start; StreamError where no router answers."""
        with ExitStack() as stack:
            session = subscribing_session(self._router, config=None)
            stack.callback(close, session)
            node = self._node_token(session)
            stack.callback(node.undeclare)
            encoders = {"image_raw": (IMAGE, self._image), "camera_info": (CAMERA_INFO, self._camera_info),
                        "depth/image": (IMAGE, self._depth), "points": (POINTS, self._points),
                        "contact": (POINT, self._contact)}  # fmt: skip
            self._topics = [
                self._declared(session, f"{self.prefix}/{topic}", kind, encode, number)
                for number, (topic, (kind, encode)) in enumerate(encoders.items(), 1)
            ]
            self._diagnostics = self._declared(session, "/diagnostics", DIAGNOSTICS, None, len(encoders) + 1)
            thread = threading.Thread(target=self._publish, name="ros2", daemon=True)
            thread.start()
            stack.callback(thread.join)
            stack.callback(self._ended.set)
            self._until = stack.pop_all()
        return self

    def __exit__(self, *problem: object) -> None:
        """Stop; the node leaves ROS's graph."""
        self._until.close()

    def _node_token(self, session: zenoh.Session) -> zenoh.LivelinessToken:
        self._node = f"@ros2_lv/{self._domain}/{session.info.zid()}/0"
        return session.liveliness().declare_token(f"{self._node}/0/NN/%/%/{self._node_name}")

    @property
    def _node_name(self) -> str:
        return f"gellight_{self._name}"

    def _declared(self, session: zenoh.Session, topic: str, kind: str, encode: Encode | None, number: int) -> Topic:
        package, _, name = kind.split("/")
        described = f"{package}::msg::dds_::{name}_/{HASHES[kind]}"
        publisher = session.declare_publisher(
            f"{self._domain}{topic}/{described}", congestion_control=zenoh.CongestionControl.DROP
        )
        token = f"{self._node}/{number}/MP/%/%/{self._node_name}/{topic.replace('/', '%')}/{described}/{QOS}"
        return Topic(publisher, (session.liveliness().declare_token(token),), encode, uuid.uuid4().bytes)

    def _publish(self) -> None:
        number, told_s = 0, 0.0
        while not self._ended.is_set():
            if time.monotonic() - told_s >= DIAGNOSTICS_S:
                told_s = time.monotonic()
                self._put(self._diagnostics, self._state())
            wanted = [topic for topic in self._topics if topic.wanted]
            try:
                number, frame = self._daemon.delivered.take(number, POLL_S)
            except TimeoutError:
                continue
            except Exception:
                return  # the frames have ended, and who runs the daemon is told why
            for topic in wanted:
                assert topic.encode is not None
                self._put(topic, topic.encode(frame))

    def _put(self, topic: Topic, content: bytes) -> None:
        self._count += 1
        attachment = struct.pack("<qqB16s", self._count, time.time_ns(), len(topic.gid), topic.gid)
        topic.publisher.put(content, attachment=attachment)

    # ---- messages ----

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
        points = points_of(frame.depth_mm, frame.provenance.pixel_size_mm) * np.float32(1e-3)
        height, width, _ = points.shape
        writer = CdrWriter().header(taken_s(frame), f"{self._name}_gel").put("I", height, width, 3)
        for number, name in enumerate("xyz"):
            writer.string(name).put("I", 4 * number).put("B", FLOAT32).put("I", 1)
        return writer.put("B", 0).put("I", 12, 12 * width).blob(points.tobytes()).put("B", 1).finish()

    def _contact(self, frame: TactileFrame) -> bytes:
        x_mm, y_mm = frame.contact.centroid_mm or (nan, nan)
        place_m = x_mm * 1e-3, -y_mm * 1e-3, frame.contact.indentation_mm * 1e-3
        return CdrWriter().header(taken_s(frame), f"{self._name}_gel").put("d", *place_m).finish()

    def _state(self) -> bytes:
        """Return the status as diagnostics: level 2 (error) for what stops frames, 1 for what the watch has found."""
        status = self._daemon.status()
        watch = self._daemon.watch
        findings = [finding.text for finding in watch.findings()] if watch else []
        error = str(status["error"] or "")
        values = {name: str(status[name]) for name in ("fps", "frames", "lost", "dropped", "mode")}
        writer = CdrWriter().header(time.time(), "").put("I", 1).put("B", 2 if error else 1 if findings else 0)
        writer.string(f"gellight: {self._name}").string(error or "; ".join(findings) or "ok").string(self._name)
        writer.put("I", len(values))
        for name, value in values.items():
            writer.string(name).string(value)
        return writer.finish()


def taken_s(frame: TactileFrame) -> float:
    """Return when the exposure began, Unix time."""
    assert frame.provenance is not None
    return frame.provenance.unix_s
