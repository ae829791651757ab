"""A client that knows Foxglove's protocol and nothing of GelLight sees the sensor; the shipped layout fits."""

import asyncio
import json
import re
import runpy
import struct
import sys
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from typing import Any

import aiohttp
import numpy as np
import pytest

from gellight.base.errors import StreamError
from gellight.base.settings import load_settings
from gellight.cli.one_sensor import published
from gellight_ros.foxglove import FoxgloveServer
from tests.helpers.cdr import decoded
from tests.helpers.places import CHECKOUT
from tests.helpers.streamed import SHAPE, BumpReconstructor, bump_daemon
from tests.helpers.waiting import eventually
from tests.helpers.weighed import HeavyFrames

LAYOUT = CHECKOUT / "docs/foxglove/layout.json"
TOPICS = {
    "/gellight/image_raw": "sensor_msgs/msg/Image",
    "/gellight/camera_info": "sensor_msgs/msg/CameraInfo",
    "/gellight/depth/image": "sensor_msgs/msg/Image",
    "/gellight/points": "sensor_msgs/msg/PointCloud2",
    "/gellight/contact": "geometry_msgs/msg/PointStamped",
    "/gellight/contact/wrench": "geometry_msgs/msg/WrenchStamped",
    "/gellight/contact/wrench_covariance": "std_msgs/msg/Float64MultiArray",
    "/gellight/contacts": "sensor_msgs/msg/PointCloud2",
    "/gellight/object/pose": "geometry_msgs/msg/PoseWithCovarianceStamped",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
}
MESSAGE = 1
"""first byte of a binary message that carries data; then the subscription (uint32) and the time (uint64, ns)"""


def looked_at(url: str, topics: set[str]) -> dict[str, Any]:
    """Return the first message of each topic, decoded by the definition that the server sent."""
    return asyncio.run(asyncio.wait_for(_looked_at(url, topics), 30))


@asynccontextmanager
async def connected(url: str, **how: Any) -> AsyncIterator[aiohttp.ClientWebSocketResponse]:
    async with (
        aiohttp.ClientSession() as client,
        client.ws_connect(url, protocols=["foxglove.sdk.v1"], max_msg_size=0, **how) as wire,
    ):
        yield wire


async def _looked_at(url: str, topics: set[str]) -> dict[str, Any]:
    async with connected(url) as wire:
        channels: list[dict[str, Any]] = []
        while not channels:
            told = await wire.receive_json()
            channels = told["channels"] if told["op"] == "advertise" else []
        assert {one["topic"]: one["schemaName"] for one in channels} == TOPICS
        wanted = {number: one for number, one in enumerate(channels) if one["topic"] in topics}
        asked = [{"id": number, "channelId": one["id"]} for number, one in wanted.items()]
        await wire.send_json({"op": "subscribe", "subscriptions": asked})
        got: dict[str, Any] = {}
        while len(got) < len(wanted):
            content = await wire.receive_bytes()
            kind, number, _ = struct.unpack_from("<BIQ", content)
            assert kind == MESSAGE
            channel = wanted[number]
            assert (channel["encoding"], channel["schemaEncoding"]) == ("cdr", "ros2msg")
            got.setdefault(channel["topic"], decoded(content[13:], channel["schema"]))
        return got


@pytest.fixture
def served() -> Iterator[tuple[str, BumpReconstructor]]:
    daemon, made = bump_daemon(period_s=0.02, measures=HeavyFrames())
    with daemon, FoxgloveServer(daemon, name="left finger", port=0) as server:
        yield server.url, made


def test_every_topic_arrives(served: tuple[str, BumpReconstructor]) -> None:
    url, made = served
    # without marker dots, and nobody asked for tracking
    got = looked_at(url, set(TOPICS) - {"/gellight/contact/wrench_covariance", "/gellight/object/pose", "/tf"})
    height, width = SHAPE
    image, depth = got["/gellight/image_raw"], got["/gellight/depth/image"]
    assert (image.encoding, image.height, image.width, image.step) == ("rgb8", height, width, 3 * width)
    assert any(np.array_equal(image.data, one.camera_frame.image.ravel()) for one in list(made.given.values()))
    assert depth.encoding == "32FC1"
    felt_m = depth.data.view("<f4").reshape(SHAPE)
    assert any(np.array_equal(felt_m, one.depth_mm * np.float32(1e-3)) for one in list(made.given.values()))
    assert got["/gellight/points"].header.frame_id == "gellight_gel"
    assert 0.0004 < got["/gellight/contact"].point.z < 0.01, "metres"
    wrench = got["/gellight/contact/wrench"].wrench
    parts = [getattr(part, axis) for part in (wrench.force, wrench.torque) for axis in "xyz"]
    assert parts == [0, 0, 1.25, 0, 0, 0], "newtons, and nothing of what only dots tell"
    assert got["/diagnostics"].status[0].message == "ok"


def test_what_nobody_looks_at_is_not_made(
    served: tuple[str, BumpReconstructor], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> bytes:
        raise AssertionError("points were made")

    monkeypatch.setattr("gellight_ros.ros_topics.points_of", refuse)
    assert set(looked_at(served[0], {"/gellight/contact"})) == {"/gellight/contact"}


def test_a_viewer_that_reads_nothing_slows_nothing(served: tuple[str, BumpReconstructor]) -> None:
    """It has subscribed to all and its socket is full: the frames go on."""
    url, made = served

    async def stand_still() -> None:
        async with connected(url) as wire:
            asked = [{"id": number, "channelId": number} for number in range(1, 6)]
            await wire.send_json({"op": "subscribe", "subscriptions": asked})
            transport = wire._response.connection.transport
            transport.pause_reading()
            before = len(made.given)
            await asyncio.to_thread(eventually, lambda: len(made.given) > before + 100)
            transport.resume_reading()

    asyncio.run(stand_still())


@pytest.mark.parametrize("sent", [
    "", "{", '{"op": "subscribe"}', '{"op": "nonsense"}', b"\x00\x01", b"\xff" * 1000,
    '{"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 4000000000}]}',
])  # fmt: skip
def test_hostile_messages_are_borne(served: tuple[str, BumpReconstructor], sent: str | bytes) -> None:
    async def send() -> None:
        async with connected(served[0]) as wire:
            await (wire.send_str(sent) if isinstance(sent, str) else wire.send_bytes(sent))
            await asyncio.sleep(0.1)

    asyncio.run(send())
    assert looked_at(served[0], {"/gellight/contact"})


def test_a_port_in_use_and_a_package_that_is_missing_are_told(
    served: tuple[str, BumpReconstructor], monkeypatch: pytest.MonkeyPatch
) -> None:
    port = int(served[0].rpartition(":")[2])
    with pytest.raises(StreamError, match=rf"port {port}.*in use.*foxglove_port"):
        FoxgloveServer(bump_daemon()[0], name="other", port=port).__enter__()
    monkeypatch.setitem(sys.modules, "foxglove", None)
    with pytest.raises(StreamError, match="pip install foxglove-sdk"):
        FoxgloveServer(bump_daemon()[0], name="finger", port=0).__enter__()


def test_a_sensor_that_is_to_be_shown_is_and_says_where(capsys: pytest.CaptureFixture[str]) -> None:
    settings = load_settings({"stream.foxglove": True, "stream.foxglove_port": 0})
    daemon, _ = bump_daemon(period_s=0.02)
    with daemon, published(daemon, settings, ""):
        (url,) = re.findall(r"Foxglove: open (ws://\S+)", capsys.readouterr().err)
        assert looked_at(url, {"/gellight/image_raw"})["/gellight/image_raw"].height == 48


def test_the_layout_is_current_and_shows_topics_that_are_there() -> None:
    made = runpy.run_path(str(CHECKOUT / "docs/foxglove/layout.py"))["content"]()
    assert LAYOUT.read_text() == made
    named = set(re.findall(r'"(/[\w/]+)', json.dumps(json.loads(made))))
    assert named == {"/gellight/image_raw", "/gellight/depth/image", "/gellight/points", "/gellight/contact",
                     "/gellight/contact/wrench", "/diagnostics"}  # fmt: skip
    assert named <= set(TOPICS)


@pytest.mark.parametrize(
    ("origin", "welcome"),
    [(None, True), ("https://app.foxglove.dev", True), ("http://localhost:8080", True), ("file://", True),
     ("http://example.org", False), ("https://evilfoxglove.dev", False), ("http://localhost.example.org", False),
     ("null", False), ("http://127.0.0.1.example.org", False)],
)  # fmt: skip
def test_a_web_page_of_strangers_does_not_see_the_sensor(origin: str | None, welcome: bool) -> None:
    """Nor does it find the server behind the door: it is at one of 65536 addresses."""

    async def connect(url: str) -> bool:
        headers = {"Origin": origin} if origin else {}
        try:
            async with connected(url, headers=headers) as wire:
                return (await wire.receive_json())["op"] == "serverInfo"
        except aiohttp.WSServerHandshakeError as error:
            return error.status != 403

    daemon, _ = bump_daemon()
    with daemon, FoxgloveServer(daemon, name="finger", port=0) as server:
        assert asyncio.run(connect(server.url)) == welcome
