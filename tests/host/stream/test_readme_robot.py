"""The README's section "Use it from your robot": its commands run as they stand, but that ports are free ones."""

import asyncio
import json
import os
import re
import shlex
import socket
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from subprocess import Popen
from typing import Any

import aiohttp
import zenoh

from tests.helpers import children
from tests.helpers.places import CHECKOUT

SECTION = (CHECKOUT / "README.md").read_text().partition("## Use it from your robot")[2].partition("\n## ")[0]
BLOCKS = re.findall(r"```sh\n(.*?)```", SECTION, re.DOTALL)


def command(option: str) -> list[str]:
    """Return what the section says after `gellight`, of the block that has the option."""
    (line,) = [
        line for block in BLOCKS for line in block.splitlines() if line.startswith("gellight run") and option in line
    ]
    return shlex.split(line.removesuffix("&"))[1:]


@contextmanager
def running(arguments: list[str], says: str) -> Iterator[tuple[Popen[Any], str]]:
    """Run a command of the section until it says `says`; give it, and what it said then."""
    environment = {**os.environ, "GELLIGHT_STREAM_FOXGLOVE_PORT": "0"}
    with children.started([*children.GELLIGHT, *arguments], stderr=-1, text=True, env=environment) as verb:
        assert verb.stderr is not None
        for line in verb.stderr:
            if says in line:
                yield verb, line
                return
        raise AssertionError(f"it ended with {verb.wait()}")


def test_every_block_is_tried() -> None:
    assert [len(re.findall("--ros2|--foxglove|live.py|lerobot-record", block)) for block in BLOCKS] == [1, 1, 1, 1]


def test_python() -> None:
    (program,) = re.findall(r"^python (\S+)$", BLOCKS[0], re.MULTILINE)
    (line,) = [line for line in BLOCKS[0].splitlines() if line.startswith("gellight")]
    with running(shlex.split(line.removesuffix("&"))[1:], "publishing"):
        done = children.run([sys.executable, CHECKOUT / program])
    assert done.returncode == 0, done.stderr
    assert re.search(r"(0\.9\d|1\.0\d) mm deep over", done.stdout)


def test_ros_2() -> None:
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    config = zenoh.Config()
    for name, value in {"mode": "router", "listen/endpoints": [f"tcp/127.0.0.1:{port}"]}.items():
        config.insert_json5(name, json.dumps(value))
    config.insert_json5("scouting/multicast/enabled", "false")
    came = threading.Event()
    with zenoh.open(config) as router:
        held = router.declare_subscriber("0/sim/depth/image/**", lambda _: came.set())
        with running([word.replace("localhost:7447", f"127.0.0.1:{port}") for word in command("--ros2")], "ROS 2"):
            assert came.wait(60)
        held.undeclare()


def test_foxglove() -> None:
    async def greeting(url: str) -> str:
        async with aiohttp.ClientSession() as client, client.ws_connect(url, protocols=["foxglove.sdk.v1"]) as wire:
            return str((await wire.receive_json(timeout=30))["name"])

    with running(command("--foxglove"), "Foxglove: open") as (_, line):
        assert asyncio.run(greeting(line.split()[-1])) == "GelLight sim"
