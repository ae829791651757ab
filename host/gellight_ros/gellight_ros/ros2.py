"""Topics of ROS 2 without ROS: the messages and the keys of rmw_zenoh, by the router that ROS 2 runs (`rmw_zenohd`).

    /NAME/image_raw ...   see ros_topics.py
    /diagnostics          once a second

A topic that nobody subscribes to costs nothing.
"""

import struct
import time
import uuid
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any, Self

import zenoh

from gellight.base import logs
from gellight.base.errors import StreamError
from gellight.base.settings import Settings
from gellight.daemon.session import SensorSession
from gellight.frames.frames import TactileFrame
from gellight.photometric.ring_geometry import RingGeometry
from gellight.recording.recording_file import topic_name
from gellight.stream.frame_thread import sending
from gellight.stream.network import close, is_loopback, opened_session, subscribing_session
from gellight_ros.ros_topics import DIAGNOSTICS_S, DIAGNOSTICS_TOPIC, RosTopics, topic_of
from gellight_ros.ros_types import DIAGNOSTICS, HASHES

ROUTER_COMMAND = "`ros2 run rmw_zenoh_cpp rmw_zenohd`"
QOS = "::,1:,:,:,,"
"""reliable, volatile, the last one: as rmw_zenoh writes it, where empty stands for the default"""


@contextmanager
def to_ros2(daemon: SensorSession, name: str, settings: Settings) -> Iterator[None]:
    """Publish by the router `stream.ros2`, as long as the context lasts, and say so; StreamError where none answers."""
    chosen = settings.stream
    distance_mm = settings.geometry.camera_height_mm or RingGeometry.camera_height_mm
    with Ros2Publisher(daemon, chosen.ros2, name=name, domain=chosen.ros2_domain, distance_mm=distance_mm) as topics:
        if topics.is_router:
            logs.say(f"no router of ROS 2 answered at {chosen.ros2}: this program is it as long as it runs")
        logs.say(f"ROS 2 topics: {topics.prefix}/...")
        yield


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


def routed_session(endpoint: str) -> tuple[zenoh.Session, bool]:
    """Open a session to ROS 2's router at `endpoint`; where this computer has none there, open one that is the router.

    Return it, and whether it is the router. Raises StreamError with the remedy.
    """
    try:
        return subscribing_session(endpoint, config=None), False
    except StreamError as error:
        missing = f"no router of ROS 2 answers at {endpoint}"
        if not is_loopback(endpoint):
            raise StreamError(f"{missing}: start it there by {ROUTER_COMMAND}") from error
    listen = {"listen/endpoints": [endpoint], "listen/exit_on_failure": True}
    try:
        return opened_session(zenoh.Config(), {"mode": "router", **listen}), True
    except StreamError as error:
        raise StreamError(f"{missing}, and it cannot be made there ({error}): start one by {ROUTER_COMMAND}") from error
