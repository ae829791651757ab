"""Live view in Foxglove: the messages of ROS 2 by WebSocket, with the package foxglove-sdk.

One server shows one sensor, so topics have the same names for every sensor and one layout fits: `/gellight/image_raw`,
`/gellight/depth/image` and so on, see ros_topics.py, and `/diagnostics` once a second. Topics that nobody looks at cost
nothing. A viewer may look and do nothing else, and who comes from a web page of strangers is refused, see origins.py.
"""

import secrets
import sys
import time
from contextlib import ExitStack
from typing import TYPE_CHECKING, Self

from gellight.base.errors import StreamError
from gellight.base.packages import needed
from gellight.daemon.session import SensorSession
from gellight.frames.frames import TactileFrame
from gellight.recording.ros_messages import DEFINITIONS, DIAGNOSTICS
from gellight.stream.frame_thread import sending
from gellight.stream.origins import guarded
from gellight.stream.ros_topics import DIAGNOSTICS_S, DIAGNOSTICS_TOPIC, RosTopics, taken_s, topic_of

if TYPE_CHECKING:
    from foxglove import Channel

NAME = "gellight"
"""of every sensor in topics and coordinate frames"""
BACKLOG = 20
"""messages that wait for a slow viewer, those of four frames; older ones are dropped"""


class FoxgloveServer:
    """Shows a daemon that runs; a context manager."""

    def __init__(self, daemon: SensorSession, *, name: str, port: int, lan: bool = False) -> None:
        """Serve on `port`, 0 for a free one, of 127.0.0.1, or with `lan` of every network. name: shown in Foxglove."""
        self._daemon, self._name, self._port, self._host = daemon, name, port, "0.0.0.0" if lan else "127.0.0.1"
        self._messages = RosTopics(daemon, NAME)
        self._diagnosed_s = 0.0
        self._until = ExitStack()
        self.url = ""
        """that Foxglove opens, as seen from this computer"""

    def __enter__(self) -> Self:
        """Start; raises StreamError where the package is missing or the port is in use."""
        with needed("Foxglove needs a package: pip install foxglove-sdk", StreamError):
            import foxglove
        self._context = context = foxglove.Context()  # the server and its channels end with it

        def channel(topic: str, kind: str) -> "Channel":
            schema = foxglove.Schema(name=kind, encoding="ros2msg", data=DEFINITIONS[kind].encode())
            made = foxglove.Channel(topic, schema=schema, message_encoding="cdr", context=context)
            stack.callback(made.close)
            return made

        inner = ".".join(map(str, (127, *secrets.token_bytes(2), 1))) if sys.platform == "linux" else "127.0.0.1"
        with ExitStack() as stack:  # the server itself is where no page finds it
            topics = self._messages.of_frames
            self._channels = [
                (channel(topic_of(f"/{NAME}", name), kind), encode) for name, (kind, encode) in topics.items()
            ]
            self._diagnostics = channel(DIAGNOSTICS_TOPIC, DIAGNOSTICS)
            try:
                server = foxglove.start_server(
                    name=f"GelLight {self._name}", host=inner, port=0, context=context,
                    supported_encodings=["cdr"], message_backlog_size=BACKLOG,
                )  # fmt: skip
            except RuntimeError as error:
                raise StreamError(f"Foxglove cannot be served ({error})") from error
            stack.callback(server.stop)
            self.url = f"ws://localhost:{stack.enter_context(guarded(self._host, self._port, (inner, server.port)))}"
            stack.enter_context(sending(self._daemon, "foxglove", self._send, self._diagnose))
            self._until = stack.pop_all()
        return self

    def __exit__(self, *problem: object) -> None:
        """Stop; viewers are disconnected."""
        self._until.close()

    def _diagnose(self) -> bool:
        """Send the diagnostics when they are due; return whether a frame is wanted too."""
        if self._diagnostics.has_sinks() and time.monotonic() - self._diagnosed_s >= DIAGNOSTICS_S:
            self._diagnosed_s = time.monotonic()
            self._diagnostics.log(self._messages.diagnostics())
        return True

    def _send(self, frame: TactileFrame) -> None:
        for channel, encode in self._channels:
            if channel.has_sinks() and (content := encode(frame)) is not None:
                channel.log(content, log_time=round(taken_s(frame) * 1e9))
