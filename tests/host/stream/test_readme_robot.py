"""What README and docs/streaming.md type runs as it stands, but on free ports: each way to a robot, in order."""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from subprocess import Popen
from typing import Any

import pytest

from tests.helpers import children
from tests.helpers.places import CHECKOUT
from tests.helpers.streamed import free_port

pytestmark = pytest.mark.nightly
README = (CHECKOUT / "README.md").read_text()
SECTION = (CHECKOUT / "docs/streaming.md").read_text().partition("## Other computers")[0]
BLOCKS = re.findall(r"```sh\n(.*?)```", SECTION, re.DOTALL)


@contextmanager
def running(arguments: list[str], says: str) -> Iterator[tuple[Popen[Any], str]]:
    """Run a command of the section until it says `says`; give it, and what it said then."""
    environment = {**os.environ, "GELLIGHT_STREAM_FOXGLOVE_PORT": "0"}
    with children.started([*children.GELLIGHT, *arguments], stderr=-1, text=True, env=environment) as verb:
        for line in verb.stderr:
            if says in line:
                yield verb, line
                return
        raise AssertionError(f"it ended with {verb.wait()}")


def test_every_block_is_tried() -> None:
    assert [len(re.findall("--ros2|--foxglove|live.py|lerobot-record", block)) for block in BLOCKS] == [1, 1, 1, 1]


SLOW = "sim://?fps=4"
"""three sensors at 30 frames/s, each of which stays open, ask for more than two processors have"""
LEFT_OUT = ("git clone", "make demo", ". .venv/", "pip install", "lerobot-record", "sudo", "gellight calibrate")
"""what is open already, what this environment has, what needs one of its own, and what tests/test_first_hour.py runs"""
ENDED = {
    "--foxglove$": "--frames 5",
    "^gellight run$": f"--frames 5 --sensor {SLOW}",
    "^gellight doctor$": "|| test $? = 1",
}
"""what is added to a line: an end, a sensor, the status where none is plugged in"""


def typed(port: int) -> str:
    """Return every block of the README, then of the ways to a robot, as it is typed into one shell."""
    script = ["set -eu", "trap 'kill $(jobs -p)' EXIT"]
    blocks = [*re.findall(r"```(sh|python)\n(.*?)```", README, re.DOTALL), *(("sh", block) for block in BLOCKS)]
    for kind, block in blocks:
        if kind == "python":
            script += ["python - <<'END'", block, "END"]
            continue
        for line in block.splitlines():
            if not line.startswith(LEFT_OUT):
                added = [more for lines, more in ENDED.items() if re.search(lines, line)]
                script.append(" ".join([line.replace("localhost:7447", f"127.0.0.1:{port}"), *added]))
    return "\n".join(script)


@pytest.mark.timeout(700)
def test_every_block_runs_in_order_while_the_demo_is_open(tmp_path: Path) -> None:
    """`ros2_check.py` is told the port of this test."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    folders = {f"XDG_{kind}_HOME": str(tmp_path / kind) for kind in ("CONFIG", "STATE", "DATA")}
    ports = {"GELLIGHT_STREAM_FOXGLOVE_PORT": "0", "GELLIGHT_DASHBOARD_PORT": "0"}
    environment = {**os.environ, **folders, **ports, "PATH": path}
    port = free_port()
    script = typed(port).replace("ros2_check.py", f"ros2_check.py tcp/127.0.0.1:{port}")
    script = script.replace("sim://?object", f"{SLOW}&object")
    with running(["demo", "--no-browser", "--port", "0", "--sensor", SLOW], "publishing") as (_, line):
        assert "'sim'" in line
        done = children.run(
            ["bash", "-c", script], cwd=CHECKOUT, env=environment, stderr=subprocess.STDOUT, timeout_s=600
        )
    assert done.returncode == 0, done.stdout
    names = re.findall(r"--name (\w+)", SECTION)
    assert len(names) == 2
    assert [name for name in names if f"gellight.subscribe('{name}')" not in done.stdout] == []
    assert re.search(rf"^frames of {names[0]}\n(0\.9|1\.0)\d mm deep over", done.stdout, re.MULTILINE), done.stdout
    (shown,) = re.findall(r"!\[(/\S+), and (/\S+) from", SECTION)
    for topic in shown:
        assert f"\n{topic}: " in done.stdout, done.stdout
    assert "Foxglove: open" in done.stdout
