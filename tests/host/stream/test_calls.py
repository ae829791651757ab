"""Other programs ask the daemon, whatever bytes they send: an answer or a refusal, and the frames go on."""

import json
import re
import socket
import threading
import time
from contextlib import ExitStack, suppress
from typing import get_args

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gellight.base.errors import InputError, StreamError
from gellight.base.locking import lock
from gellight.base.runtime_folder import folder
from gellight.daemon.calls import AnyCall
from gellight.sensor.v4l2.options import parse_url
from gellight.stream import subscription
from gellight.stream.network import key, subscribing_session
from gellight.stream.publisher import Publisher
from gellight.stream.running import running
from gellight.stream.sensor import Sensor
from gellight.stream.source import NoFrameError
from gellight.stream.subscription import subscribe
from tests.helpers.command_line import invoke
from tests.helpers.streamed import bump_daemon
from tests.helpers.weighed import HeavyFrames


def test_a_call_is_answered_with_what_the_daemon_says_until_the_subscription_is_closed() -> None:
    daemon, _ = bump_daemon()
    with daemon, Publisher(daemon):
        frames = subscribe()
        assert frames.status()["mode"] == "formula"
        with pytest.raises(InputError, match="no light ring"):
            frames.light(None)
        with pytest.raises(InputError, match="not watched"):
            frames.zero()
        frames.close()
        for ask in (frames.status, frames.zero, lambda: frames.bundle):
            with pytest.raises(StreamError, match="subscribe anew"):
                ask()


def test_a_daemon_that_takes_too_long_is_said_to_be_busy(monkeypatch: pytest.MonkeyPatch) -> None:
    daemon, _ = bump_daemon()
    asked, answer = threading.Event(), threading.Event()
    monkeypatch.setattr(subscription, "CALL_S", 0.2)
    with daemon, Publisher(daemon), subscribe() as frames:
        monkeypatch.setattr(daemon, "status", lambda: (asked.set(), answer.wait(60), {})[-1])
        with pytest.raises(StreamError, match=r"did not answer within 0\.2 s: is its machine busy"):
            frames.status()
        assert asked.wait(60)
        answer.set()


def test_why_no_frame_comes_is_told_as_far_as_the_daemon_says_it(monkeypatch: pytest.MonkeyPatch) -> None:
    daemon, _ = bump_daemon(period_s=5)
    with daemon, Publisher(daemon), subscribe(patience_s=0.1) as frames:
        monkeypatch.setattr(daemon, "status", lambda: 1 / 0)
        with pytest.raises(NoFrameError, match=r"no frame for 0\.1 s: the call failed in the daemon; its log says why"):
            frames.next_frame()


CHANGES = [
    {"type": "light", "colours": [[255, 255, 255]] * 12},
    {"type": "mode", "mode": "photometric"},
    {"type": "zero"},
    {"type": "track", "on": True},
    {"type": "press", "object": "BALL", "depth_mm": 1, "x_mm": 0, "y_mm": 0},
    {"type": "drag", "x_mm": 0, "y_mm": 0, "turn_rad": 0},
    {"type": "release"},
    {"type": "calibrate", "request": {}},
    {"type": "act", "action": "next"},
    {"type": "restore", "identity": "0123456789abcdef"},
    {"type": "scan", "name": "part"},
    {"type": "scan-undo"},
    {"type": "scan-end"},
]


def test_every_call_that_is_not_of_a_reader_is_listed_here() -> None:
    kinds = {get_args(one.model_fields["type"].annotation)[0] for one in get_args(AnyCall) if not one.reads}
    assert {call["type"] for call in CHANGES} == kinds


def test_who_has_no_token_may_read_and_change_nothing() -> None:
    """Another user of this computer, or another computer: what reaches the port."""
    daemon, _ = bump_daemon()
    with daemon, Publisher(daemon, name="finger") as publisher:
        session = subscribing_session(running()[0].endpoint, config=None)
        for call in CHANGES:
            for brought in (None, "", "a", publisher.token[:-1], publisher.token + "a", b"\xff"):
                content = json.dumps(call)
                (reply,) = session.get(key("finger", "call"), payload=content, attachment=brought, timeout=60)
                assert "changed by those that bring its token" in reply.err.payload.to_string()
        (reply,) = session.get(key("finger", "call"), payload='{"type": "status"}', timeout=60)
        assert reply.ok is not None
        (reply,) = session.get(key("finger", "call"), payload=b"[" * 50_000, timeout=60)
        assert "no call of GelLight" in reply.err.payload.to_string()
        session.close()


def test_a_program_of_this_user_has_the_token_and_another_computer_is_given_it() -> None:
    daemon, _ = bump_daemon()
    with daemon, Publisher(daemon, name="finger", token="a-token-of-my-own") as publisher:
        url = running()[0].endpoint.replace("tcp/", "zenoh://") + "/finger"
        assert publisher.token == running()[0].token == "a-token-of-my-own"
        with subscribe() as own, subscribe(url, token="a-token-of-my-own") as told, subscribe(url) as stranger:
            for frames in (own, told):
                with pytest.raises(InputError, match="objects can be pressed into a simulated gel only"):
                    frames.press("BALL", 1.0)
            with pytest.raises(InputError, match="finger may be read by every program"):
                stranger.press("BALL", 1.0)
            assert stranger.next_frame().contact is not None
    other, _ = bump_daemon()
    with other, Publisher(other) as first, Publisher(other, name="other") as second:
        assert len({first.token, second.token, "a-token-of-my-own"}) == 3, "each start has another"


def test_hostile_bytes_on_the_port_do_not_disturb_the_stream() -> None:
    daemon, _ = bump_daemon()
    with daemon, Publisher(daemon), subscribe() as frames:
        port = int(running()[0].endpoint.rpartition(":")[2])
        for content in (b"\0" * 70000, b"\xff" * 70000, b"GET / HTTP/1.0\r\n\r\n", bytes(range(256)) * 50):
            with socket.create_connection(("127.0.0.1", port)) as wire, suppress(OSError):  # it hung up
                wire.sendall(content)
        before = frames.next_frame().camera_frame.sequence
        time.sleep(0.1)
        assert frames.next_frame().camera_frame.sequence > before


def test_the_status_says_what_the_newest_frame_feels() -> None:
    daemon, made = bump_daemon(measures=HeavyFrames())
    with daemon, Publisher(daemon, name="finger"), subscribe("finger") as frames:
        frames.next_frame()
        told = frames.status()["touch"]
        felt = next(one for one in list(made.given.values()) if one.contact.indentation_mm == told["indentation_mm"])
        assert told["area_mm2"] == felt.contact.area_mm2
        largest_mpa = felt.depth_mm.max() / 8
        assert told["force"] == {
            "normal_n": 1.25, "error_n": 0.1, "flags": ["heavier"], "largest_pressure_mpa": largest_mpa,
        }  # fmt: skip
        said = invoke("status", "finger")
        assert re.search(r"; \d\.\d{3} mm deep, 1\.25 ± 0\.10 N, up to \d\.\d{3} MPa\n$", said.stdout), said.output
        assert json.loads(invoke("status", "--json").stdout)["finger"]["touch"]["force"]["normal_n"] == 1.25


def test_the_status_of_a_sensor_without_a_constant_has_no_force() -> None:
    daemon, _ = bump_daemon()
    with daemon, Publisher(daemon, name="finger"), subscribe("finger") as frames:
        frames.next_frame()
        assert frames.status()["touch"]["force"] is None
        said = invoke("status").stdout
        assert re.search(r"; \d\.\d{3} mm deep\n$", said), said


@pytest.mark.parametrize("kind", ["connect", "subscribe"])
def test_bad_arguments_are_refused_in_words_by_both_kinds_of_source(kind: str) -> None:
    daemon, _ = bump_daemon()
    with ExitStack() as stack:
        if kind == "subscribe":
            stack.enter_context(daemon)
            stack.enter_context(Publisher(daemon, name="finger"))
        source = stack.enter_context(subscribe("finger") if kind == "subscribe" else Sensor(daemon))
        for colours in (np.full((12, 3), 300), np.full((12, 3), 0.5), np.zeros((12, 4), np.uint8), np.zeros(12, int)):
            with pytest.raises(InputError, match=r"give \(12, 3\) whole numbers from 0 to 255"):
                source.light(colours)
        for press in (("BALL", float("nan")), (1, 0.5), ("BALL", "deep")):
            with pytest.raises(InputError, match=r"(depth_mm|object) = "):
                source.press(*press)


@pytest.mark.parametrize("url", ["v4l2://[", "sim://[x", "v4l2://[::1"])
def test_a_url_with_half_a_bracket_is_refused(url: str) -> None:
    with pytest.raises(InputError, match="is no URL"):
        parse_url(url)


@given(st.binary(max_size=6000))
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_file_of_a_daemon_may_hold_anything(content: bytes) -> None:
    """Locked as by a daemon that lives: it is passed over."""
    folder().mkdir(parents=True, exist_ok=True)
    (folder() / "x.json").write_bytes(content)
    with (folder() / "x.json").open("a+") as handle:
        assert lock(handle)
        assert running() == []
