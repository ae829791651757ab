"""Frames go to other programs, and nothing that those do slows the sensor."""

import asyncio
import os
import signal
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import gellight
from gellight.base.errors import InputError, StreamError
from gellight.frames.frames import TactileFrame
from gellight.frames.measures import MapOnRequest
from gellight.stream import publisher as publisher_module
from gellight.stream.publisher import Publisher
from gellight.stream.running import RunningDaemon, default_daemon, running
from gellight.stream.sensor import Sensor
from gellight.stream.subscription import subscribe
from tests.helpers import children
from tests.helpers.children import started
from tests.helpers.places import CHECKOUT
from tests.helpers.streamed import bump_daemon
from tests.helpers.waiting import eventually
from tests.helpers.weighed import HeavyFrames

OWN = 4242
COUNTING = """
import sys
from gellight import subscribe
with subscribe("auto") as frames:
    for _ in range(int(sys.argv[1])):
        frame = next(iter(frames))
        print(frame.camera_frame.sequence, frame.contact.indentation_mm, frame.depth_mm.shape, flush=True)
"""


def test_the_newest_frame_is_given_and_those_passed_over_are_counted() -> None:
    daemon, made = bump_daemon(period_s=0.005)
    with daemon, Publisher(daemon) as publisher, subscribe() as frames:
        first = frames.next_frame().camera_frame.sequence
        published = publisher.frames
        eventually(lambda: publisher.frames > published + 50)
        newest = max(made.given)
        second = frames.next_frame()
    assert second.camera_frame.sequence > (first + newest) / 2, "not one from the beginning of the pause"
    assert second.provenance.dropped == second.camera_frame.sequence - first - 1 > 10


def test_every_frame_is_given_on_request(monkeypatch: pytest.MonkeyPatch) -> None:
    sent: list[int] = []
    send = Publisher._send

    def noted(publisher: Publisher, frame: TactileFrame) -> None:
        sent.append(frame.camera_frame.sequence)
        send(publisher, frame)

    monkeypatch.setattr(Publisher, "_send", noted)
    daemon, _ = bump_daemon(period_s=0.05)
    with daemon, Publisher(daemon), subscribe(every=True) as frames:
        first = frames.next_frame().camera_frame.sequence
        begun = sent.index(first)
        eventually(lambda: len(sent) > begun + 10)
        assert [frames.next_frame().camera_frame.sequence for _ in range(10)] == sent[begun + 1 : begun + 11]


def test_the_event_loop_goes_on_while_a_frame_is_waited_for() -> None:
    daemon, _ = bump_daemon(period_s=0.2)
    turns = 0

    async def count() -> None:
        nonlocal turns
        while True:
            turns += 1
            await asyncio.sleep(0.001)

    async def read() -> int:
        counting = asyncio.create_task(count())
        taken = 0
        with subscribe() as frames:
            async for _ in frames:
                taken += 1
                if taken == 4:
                    break
        counting.cancel()
        return taken

    with daemon, Publisher(daemon):
        assert asyncio.run(read()) == 4
    assert turns > 20


def test_a_reader_that_stands_still_slows_nobody() -> None:
    daemon, _ = bump_daemon(period_s=0.005)
    slow = started([sys.executable, "-c", COUNTING, "1000000"], stdout=-1)
    with daemon, Publisher(daemon) as publisher, subscribe() as frames, slow as reader:
        assert reader.stdout.readline()
        os.kill(reader.pid, signal.SIGSTOP)
        published, first = publisher.frames, frames.next_frame().camera_frame.sequence
        eventually(lambda: publisher.frames > published + 200)
        assert frames.next_frame().camera_frame.sequence - first > 100


def test_nothing_is_encoded_while_nobody_reads() -> None:
    daemon, made = bump_daemon(period_s=0.005)
    with daemon, Publisher(daemon) as publisher:
        eventually(lambda: len(made.given) >= 50)
        assert publisher.frames == 0


# ---- who is found ----


FROM_HERE = """
from gellight import subscribe
from gellight.stream.publisher import Publisher
from tests.helpers.streamed import bump_daemon
daemon, _ = bump_daemon()
with daemon, Publisher(daemon, name="mine"), subscribe("auto") as frames:
    print(frames.name)
"""


def test_of_several_terminals_the_own_one_is_meant() -> None:
    daemon, _ = bump_daemon()
    with daemon, Publisher(daemon, name="demo"):
        assert children.run([sys.executable, "-c", FROM_HERE], cwd=CHECKOUT, check=True).stdout == "mine\n"


@pytest.mark.parametrize(
    ("there", "chosen"),
    [
        ([("a", OWN, 1), ("b", OWN, 2), ("c", 1, 3)], "b"),
        ([("a", 1, 1)], "a"),
        ([("a", 0, 1), ("b", 0, 2)], None),  # of a system that has no terminals
        ([("a", 1, 1), ("b", 1, 2)], None),
        ([("a", OWN, 1), ("b", OWN, 2), ("c", OWN, 2)], None),  # two sensors of one program
    ],
)
def test_auto_is_the_last_of_this_terminal_where_that_is_told(
    there: list[tuple[str, int, int]], chosen: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "getsid", lambda process: OWN)  # 0 where the session began outside of a container
    daemons = [
        RunningDaemon(name=name, endpoint="", sensor="", memory="", process=one, since_unix_s=one, session=terminal)
        for name, terminal, one in there
    ]  # fmt: skip
    found = default_daemon(daemons)
    assert (found and found.name) == chosen


def test_a_daemon_that_starts_now_is_waited_for() -> None:
    begun_s = time.monotonic()
    with pytest.raises(StreamError, match="no daemon publishes late"):
        subscribe("late")
    looked_s = time.monotonic() - begun_s
    daemon, _ = bump_daemon()
    publisher = Publisher(daemon, name="late")
    begins = threading.Timer(looked_s + 0.5, publisher.__enter__)  # after it was looked for in vain
    with daemon:
        begins.start()
        with subscribe("late", wait_s=60) as frames:
            assert frames.next_frame().depth_mm.max() > 0.4
        begins.join()
        publisher.__exit__()


def test_a_name_that_nobody_has_is_waited_for_as_long_as_asked(caplog: pytest.LogCaptureFixture) -> None:
    daemon, _ = bump_daemon()
    begun_s = time.monotonic()
    with daemon, Publisher(daemon, name="ball"):
        with pytest.raises(StreamError, match=r"publishes bal .*there are ball"):
            subscribe("bal", wait_s=6)
        assert time.monotonic() - begun_s >= 6
    (said,) = caplog.messages
    assert "there are ball; waiting" in said


def test_of_several_sensors_one_has_to_be_named_simulated_ones_are_numbered_and_no_name_is_given_twice() -> None:
    (one, _), (other, _) = bump_daemon(), bump_daemon()
    with one, other:
        with Publisher(one, name="left"), Publisher(other, name="right"):
            for name in ("auto", "thumb"):
                with pytest.raises(StreamError, match="left, right"):
                    subscribe(name)
            with subscribe("right") as frames:
                assert frames.name == "right"
        with Publisher(one) as first, Publisher(other) as second:
            assert [first.name, second.name] == ["images", "images-2"]
        with Publisher(one, name="finger"):
            with pytest.raises(StreamError, match=rf"finger is published already by process {os.getpid()}"):
                Publisher(other, name="finger").__enter__()
            assert [daemon.name for daemon in running()] == ["finger"]
    assert running() == []


def test_a_daemon_that_was_killed_leaves_its_name_free(tmp_path: Path) -> None:
    code = (
        "import time; from gellight.stream.publisher import Publisher; from tests.helpers.streamed import bump_daemon\n"
        "daemon, _ = bump_daemon()\n"
        "with daemon, Publisher(daemon, name='finger'): print('there', flush=True); time.sleep(60)"
    )
    with started([sys.executable, "-c", code], stdout=-1) as killed:
        assert killed.stdout.readline() == b"there\n"
        assert [daemon.process for daemon in running()] == [killed.pid]
    assert (tmp_path / "gellight/finger.json").exists()
    assert running() == []
    daemon, _ = bump_daemon()
    with daemon, Publisher(daemon, name="finger"):
        assert [one.process for one in running()] == [os.getpid()]


@pytest.mark.parametrize("url", ["http://localhost", "zenoh://", "zenoh://host:port", "zenoh://host:99999"])
def test_a_url_that_names_no_daemon_is_refused(url: str) -> None:
    with pytest.raises(InputError, match="names no daemon"):
        subscribe(url)


# ---- in the same process ----


def test_every_frame_of_a_sensor_in_this_process_on_request() -> None:
    daemon, made = bump_daemon(frames=20, period_s=0.02)
    with Sensor(daemon, every=True) as sensor:
        got = [frame.camera_frame.sequence for frame in sensor]
    assert got == sorted(made.given), "none is left out, and the end is no error"


def test_the_simulated_sensor_is_lit_pressed_and_released() -> None:
    with gellight.connect("sim://?programme=0", patience_s=120) as sensor:
        flat = sensor.next_frame()
        assert flat.contact.indentation_mm < 0.05
        assert flat.camera_frame.image.mean() > 20, "its LEDs are on"
        sensor.press("BALL", 1.0)
        assert sensor.next_frame().contact.indentation_mm == pytest.approx(1.0, abs=0.05), "the first one after it"
        sensor.light(np.zeros((12, 3), np.uint8))
        assert sensor.next_frame().camera_frame.image.mean() < 5
        sensor.light(None)
        assert sensor.next_frame().camera_frame.image.mean() > 20
        sensor.release()
        assert sensor.next_frame().contact.indentation_mm < 0.05
        with Publisher(sensor.daemon, name="pressed"), subscribe("pressed") as frames:
            for depth_mm in (0.8, 0.4):
                frames.press("BALL", depth_mm)
                assert frames.next_frame(60).contact.indentation_mm == pytest.approx(depth_mm, abs=0.05)
        assert sensor.bundle.identity == sensor.next_frame().provenance.zero


def test_a_program_that_does_not_close_its_sensor_ends() -> None:
    code = "import gellight\ns = gellight.connect('sim://')\ns.press('BALL', 1.0)\nprint(s.next_frame())"
    done = children.run([sys.executable, "-c", code])
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("use", ["frames.next_frame()", "frames.listen(print); frames.next_frame()"])
def test_a_program_that_does_not_close_its_subscription_ends(use: str) -> None:
    daemon, _ = bump_daemon(period_s=0.02)
    with daemon, Publisher(daemon, name="finger"):
        code = f"import gellight\nframes = gellight.subscribe('finger')\n{use}"
        assert children.run([sys.executable, "-c", code]).returncode == 0


def test_a_map_is_sent_while_somebody_asks_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Readers who did not ask find it in the message too; after the last who asked has left, nobody computes it."""
    asked: list[list[MapOnRequest]] = []
    known = publisher_module.encoded
    monkeypatch.setattr(
        publisher_module, "encoded", lambda frame, maps=(): (asked.append(sorted(maps)), known(frame, maps))[1]
    )
    daemon, made = bump_daemon(measures=HeavyFrames())
    with daemon, Publisher(daemon, name="finger"), subscribe("finger") as plain:
        plain.next_frame()
        assert asked[-1] == []
        with subscribe("finger", maps=["pressure_mpa", "confidence"]) as frames:
            got = next(frame for frame in frames if asked[-1])
            got = frames.next_frame()
            assert asked[-1] == sorted(MapOnRequest)
            sent = made.given[got.camera_frame.sequence]
            assert got.force.normal_n == 1.25
            assert np.array_equal(got.force.pressure_mpa, sent.depth_mm / 8)
            assert np.array_equal(got.confidence.quality_flags, sent.confidence.quality_flags)
        next(frame for frame in plain if not asked[-1])


@pytest.mark.parametrize("maps", ["pressure_mpa", ["pressure"], ["confidence", "quality_flags"]])
def test_a_map_that_there_is_not_is_refused(maps: object) -> None:
    with pytest.raises(InputError, match=r"maps=.*give a list of pressure_mpa, confidence"):
        subscribe("finger", maps=maps)
