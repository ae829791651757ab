"""What a publisher sends goes on, whatever its readers, zenoh and a single frame do."""

import os
import shutil
import sys
import threading
import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gellight.base.errors import StreamError
from gellight.frames.frames import TactileFrame
from gellight.stream import publisher as publisher_module
from gellight.stream.frame_thread import sending, sent_to
from gellight.stream.publisher import Publisher
from gellight.stream.subscription import subscribe
from tests.helpers.children import gellight, run
from tests.helpers.doc_examples import examples
from tests.helpers.places import CHECKOUT
from tests.helpers.streamed import bump_daemon


class HeldEvent(threading.Event):
    """An event that waits in `clear` until it is told to go on, or half a second is over."""

    def __init__(self) -> None:
        super().__init__()
        self.clearing, self.go_on = threading.Event(), threading.Event()

    def clear(self) -> None:
        self.clearing.set()
        self.go_on.wait(0.5)
        super().clear()


def test_a_reader_that_comes_while_the_last_one_leaves_is_noted() -> None:
    """Zenoh tells of the readers of notes and of frames in two threads."""
    daemon, _ = bump_daemon()
    publisher: Any = Publisher(daemon)
    publisher._wanted = event = HeldEvent()
    publisher._note_readers("note", SimpleNamespace(matching=True))
    leaving = threading.Thread(target=publisher._note_readers, args=("note", SimpleNamespace(matching=False)))
    leaving.start()
    assert event.clearing.wait(60)
    coming = threading.Thread(target=publisher._note_readers, args=("frame", SimpleNamespace(matching=True)))
    coming.start()
    coming.join(0.1)  # with a lock it waits here
    event.go_on.set()
    leaving.join()
    coming.join()
    assert event.is_set()


def test_a_frame_that_cannot_be_sent_ends_nothing(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    known, refused = publisher_module.encoded, threading.Semaphore(3)

    def encoded(frame: TactileFrame, asked: Any) -> Any:
        if refused.acquire(blocking=False):
            raise StreamError("this one not")
        return known(frame, asked)

    monkeypatch.setattr(publisher_module, "encoded", encoded)
    daemon, _ = bump_daemon()
    with daemon, Publisher(daemon), subscribe(patience_s=60) as frames:
        frames.next_frame()
    assert [record.message for record in caplog.records] == ["publish: a frame cannot be sent"], "said once"


def test_a_question_that_fails_ends_nothing() -> None:
    """As the status, which ROS 2 and Foxglove ask for once a second."""
    asked, sent = iter([ValueError("not now"), None]), threading.Event()

    def wanted() -> bool:
        problem = next(asked, None)
        if problem is not None:
            raise problem
        return True

    daemon, _ = bump_daemon()
    with daemon, sending(daemon, "asking", lambda frame: sent.set(), wanted):
        assert sent.wait(60)


# ---- sinks and cameras of other distributions ----


EXAMPLE = CHECKOUT / "docs/examples/extending"


def planted(folder: Path) -> Path:
    """Put the example where an installer would: its file, and what its project says of entry points."""
    shutil.copy(EXAMPLE / "my_gellight.py", folder)
    points = tomllib.loads((EXAMPLE / "pyproject.toml").read_text())["project"]["entry-points"]
    told = folder / "my_gellight-0.1.0.dist-info"
    told.mkdir()
    (told / "METADATA").write_text("Metadata-Version: 2.1\nName: my_gellight\nVersion: 0.1.0\n")
    lines = [
        f"[{group}]\n" + "\n".join(f"{name} = {place}" for name, place in those.items())
        for group, those in points.items()
    ]
    (told / "entry_points.txt").write_text("\n\n".join(lines))
    return folder


def runs(tmp_path: Path, place: Path) -> None:
    path = os.pathsep.join([str(place), os.environ.get("PYTHONPATH", "")])
    told = ["--sensor", "grey://127", "--set", "stream.name=mine", "--frames", "20"]
    told += ["--set", "stream.sinks=forces", "--set", "stream.enabled=false"]
    done = gellight("run", *told, cwd=tmp_path, env={**os.environ, "PYTHONPATH": path})
    assert done.returncode == 0, done.stderr
    lines = (tmp_path / "mine.csv").read_text().splitlines()
    numbers = [int(line.split(",")[0]) for line in lines]
    assert len(numbers) > 5
    assert numbers == sorted(set(numbers))


def test_a_camera_and_a_sink_from_elsewhere_run(tmp_path: Path) -> None:
    place = tmp_path / "site"
    place.mkdir()
    runs(tmp_path, planted(place))


@pytest.mark.nightly
def test_they_are_installed_from_a_folder_outside(tmp_path: Path) -> None:
    shutil.copytree(EXAMPLE, tmp_path / "mine")
    how = ["--quiet", "--no-deps", "--no-build-isolation", "--target", tmp_path / "site"]
    run([sys.executable, "-m", "pip", "install", *how, tmp_path / "mine"], check=True)
    runs(tmp_path, tmp_path / "site")


def test_the_document_shows_the_example() -> None:
    code = (EXAMPLE / "my_gellight.py").read_text()
    shown = [line for block in examples("docs/extending.md") for line in block.splitlines()]
    assert len(shown) > 15
    assert [line for line in shown if line not in code] == []


def test_a_sink_that_nobody_has_is_refused_with_those_there_are() -> None:
    with pytest.raises(StreamError, match=r"has a sink 'forces' \(none is installed\)"), sent_to("forces", None, "x"):  # type: ignore[arg-type]
        pass
