"""Topics of ROS 2 without ROS: the messages and the keys of rmw_zenoh, by the router that ROS 2 runs (`rmw_zenohd`).

    /NAME/image_raw ...   see ros_topics.py
    /diagnostics          once a second

A topic that nobody subscribes to costs nothing. The types' hashes are those of Jazzy and later.
"""

import logging
import struct
import time
import uuid
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any, Self

import zenoh

from gellight.daemon.session import SensorSession
from gellight.frames.frames import TactileFrame
from gellight.photometric.ring_geometry import RingGeometry
from gellight.recording.recording_file import topic_name
from gellight.recording.ros_messages import (
    CAMERA_INFO,
    DIAGNOSTICS,
    IMAGE,
    MULTI_ARRAY,
    POINT,
    POINTS,
    POSE,
    TF,
    WRENCH,
)
from gellight.stream.frame_thread import sending
from gellight.stream.network import close, routed_session
from gellight.stream.ros_topics import DIAGNOSTICS_S, DIAGNOSTICS_TOPIC, RosTopics, topic_of

logger = logging.getLogger(__name__)
QOS = "::,1:,:,:,,"
"""reliable, volatile, the last one: as rmw_zenoh writes it, where empty stands for the default"""
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
"""of the types (REP 2011): who subscribes to another definition gets nothing"""


@dataclass(frozen=True)
class Topic:
    """A topic that is declared."""

    publisher: zenoh.Publisher
    token: zenoh.LivelinessToken
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
        self,
        daemon: SensorSession,
        router: str,
        *,
        name: str,
        domain: int = 0,
        distance_mm: float = RingGeometry.camera_height_mm,
    ) -> None:
        """Publish by the router at `router`, such as tcp/localhost:7447. name: of the sensor. domain: ROS_DOMAIN_ID.

        distance_mm: from the gel to the camera, which the focal length of `camera_info` goes by.
        """
        self._daemon, self._router, self._domain = daemon, router, domain
        self._name = topic_name(name)
        self.prefix = f"/{self._name}"
        self._messages = RosTopics(daemon, self._name, distance_mm)
        self.is_router = False
        """there was none on this computer: this program is it"""
        self._count, self._diagnosed_s = 0, 0.0
        self._until = ExitStack()

    def __enter__(self) -> Self:
        """Connect, declare node and topics and start; StreamError where no router answers and none can be made."""
        with ExitStack() as stack:
            session, self.is_router = routed_session(self._router)
            stack.callback(close, session)
            node = self._node_token(session)
            stack.callback(node.undeclare)
            topics = self._messages.of_frames
            self._topics = [
                (self._declared(session, topic_of(self.prefix, topic), kind, number), encode)
                for number, (topic, (kind, encode)) in enumerate(topics.items(), 1)
            ]
            self._diagnostics = self._declared(session, DIAGNOSTICS_TOPIC, DIAGNOSTICS, len(topics) + 1)
            stack.enter_context(sending(self._daemon, "ros2", self._send, self._diagnose))
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

    def _declared(self, session: zenoh.Session, topic: str, kind: str, number: int) -> Topic:
        package, _, name = kind.split("/")
        described = f"{package}::msg::dds_::{name}_/{HASHES[kind]}"
        publisher = session.declare_publisher(
            f"{self._domain}{topic}/{described}", congestion_control=zenoh.CongestionControl.DROP
        )
        token = f"{self._node}/{number}/MP/%/%/{self._node_name}/{topic.replace('/', '%')}/{described}/{QOS}"
        return Topic(publisher, session.liveliness().declare_token(token), uuid.uuid4().bytes)

    def _diagnose(self) -> bool:
        """Send the diagnostics when they are due; return whether a frame is wanted too."""
        if time.monotonic() - self._diagnosed_s >= DIAGNOSTICS_S:
            self._diagnosed_s = time.monotonic()
            self._put(self._diagnostics, self._messages.diagnostics())
        return True

    def _send(self, frame: TactileFrame) -> None:
        for topic, encode in self._topics:
            if topic.wanted and (content := encode(frame)) is not None:
                self._put(topic, content)

    def _put(self, topic: Topic, content: bytes) -> None:
        self._count += 1
        attachment = struct.pack("<qqB16s", self._count, time.time_ns(), len(topic.gid), topic.gid)
        topic.publisher.put(content, attachment=attachment)
