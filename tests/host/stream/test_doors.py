"""Every door of a running sensor, tried by another user of the computer: the table of docs/security.md.

Other computers have no other doors, and with `stream.lan` the same ones. Web pages: test_access.py of the dashboard,
test_foxglove.py.
"""

import os
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from gellight.base.errors import InputError
from gellight.base.runtime_folder import folder
from gellight.dashboard.server import DashboardServer
from gellight.stream.publisher import MOST_WAITING, Publisher
from gellight.stream.running import running
from gellight.stream.subscription import subscribe
from gellight_ros.foxglove import FoxgloveServer
from gellight_ros.ros2 import Ros2Publisher
from tests.helpers.dashboard_source import FormulaSource
from tests.helpers.places import CHECKOUT
from tests.helpers.stranger import as_stranger
from tests.helpers.streamed import bump_daemon, free_port
from tests.helpers.waiting import eventually


@pytest.mark.parametrize("config", [None, CHECKOUT / "docs/examples/local.json5"])
def test_zenoh_lets_nobody_speak_for_the_daemon(tmp_path: Path, config: Path | None) -> None:
    """Neither by a key that means the daemon's, nor where a file of settings allows all."""
    config = config and tmp_path / "all.json5"
    if config:
        config.write_text(
            '{access_control: {enabled: true, default_permission: "deny", subjects: [{id: "any"}], policies: [{rules: '
            '["all"], subjects: ["any"]}], rules: [{id: "all", permission: "allow", flows: ["egress", "ingress"], '
            'key_exprs: ["**"], messages: ["put", "delete", "declare_subscriber", "query", "reply", "declare_queryable"'
            ', "liveliness_token", "declare_liveliness_subscriber", "liveliness_query"]}]}}'
        )
    daemon, _ = bump_daemon()
    with daemon, Publisher(daemon, name="finger", config=config) as publisher:
        endpoint = running()[0].endpoint
        with speaking(endpoint):
            for target in ("finger", endpoint.replace("tcp/", "zenoh://") + "/finger"):
                only_the_daemon_is_heard(target, publisher.token)


@contextmanager
def speaking(endpoint: str) -> Iterator[None]:
    """Let a stranger speak at an address all the while, and hear nothing."""
    heard = list[object]()
    with TemporaryDirectory() as shared:
        Path(shared).chmod(0o777)  # the test's own folder is closed to others
        ready, ended = Path(shared) / "ready", Path(shared) / "ended"
        attack = threading.Thread(target=lambda: heard.append(as_stranger("speaks", endpoint, str(ready), str(ended))))
        attack.start()
        try:
            eventually(lambda: ready.exists() or not attack.is_alive(), 120)
            yield
        finally:
            ended.touch()
            attack.join()
    assert heard == [[]]


def only_the_daemon_is_heard(target: str, token: str) -> None:
    """Its frames, each deeper than the one before, and its answers."""
    with subscribe(target, every=True, token=token) as frames:
        told = {frames.next_frame().contact.indentation_mm for _ in range(50)}
        assert len(told) > 40
        assert frames.status()["mode"] == "formula"
        with pytest.raises(InputError, match=r"simulated gel only"):
            frames.press("BALL", 1.0)


def test_zenoh_gives_frames_to_all_and_changes_nothing_without_the_token() -> None:
    daemon, _ = bump_daemon()
    with daemon, Publisher(daemon, name="finger"):
        read, *changed = as_stranger("calls", running()[0].endpoint)
    assert read == "True"
    assert all("changed by those that bring its token" in said for said in changed), changed


def test_a_flood_of_calls_waits_in_a_queue_that_ends_and_keeps_nobody_waiting_who_has_the_token() -> None:
    daemon, _ = bump_daemon()
    waiting, answered = threading.Event(), list[object]()
    daemon_status = daemon.status

    def status() -> dict[str, object]:
        waiting.wait(60)
        answered.append(True)
        return daemon_status()

    daemon.status = status  # type: ignore[method-assign]
    with daemon, Publisher(daemon, name="finger"), subscribe("finger") as frames:
        asked = [threading.Thread(target=frames.status) for _ in range(MOST_WAITING)]
        for one in asked:
            one.start()
        time.sleep(1)
        told = as_stranger("flood", running()[0].endpoint)
        with pytest.raises(InputError, match="simulated gel only"):
            frames.press("BALL", 1.0)
        assert answered == [], "it was answered before those who asked first"
        waiting.set()
        for one in asked:
            one.join()
    assert len(told) == 2, told
    assert "16 calls wait for their answers already" in told[0]
    assert told[1].startswith("no call of GelLight")


def test_the_files_of_the_stream_are_their_owners_alone() -> None:
    daemon, _ = bump_daemon()
    with daemon, Publisher(daemon, name="finger"), DashboardServer(FormulaSource(), port=0) as server:
        assert server.token == (folder() / "page.token").read_text()
        tried = [folder() / "finger.json", folder() / "page.token", running()[0].memory]
        if os.getuid() == 0:
            assert set(as_stranger("files", *map(str, tried), f"/proc/{os.getpid()}/mem")) == {"PermissionError"}
        assert {Path(one).stat().st_mode & 0o077 for one in tried} == {0}


def test_foxglove_shows_and_lets_nobody_publish() -> None:
    daemon, made = bump_daemon()
    with daemon, FoxgloveServer(daemon, name="finger", port=0) as server:
        told = as_stranger("views", server.url)
        assert told in (["advertise"], ["status"]), "nothing that a client could do is offered"
        seen = len(made.given)
        eventually(lambda: len(made.given) > seen + 10)


def test_who_speaks_at_the_router_of_ros_2_neither_hears_nor_changes_what_goes_through_the_stream(
    tmp_path: Path,
) -> None:
    """Where this program is the router, too: questions with the token go through the stream's own session alone."""
    daemon, _ = bump_daemon(period_s=0.05)
    router = f"tcp/127.0.0.1:{free_port()}"
    with daemon, Publisher(daemon, name="finger") as publisher, Ros2Publisher(daemon, router, name="finger") as topics:
        assert topics.is_router
        with speaking(router):
            only_the_daemon_is_heard("finger", publisher.token)


def test_without_lan_every_door_is_this_computers_own_and_no_page_gets_an_answer_from_those_without_http() -> None:
    """No port for other computers, and no unix socket with a name."""
    before = listening()
    daemon, _ = bump_daemon()
    with daemon, Publisher(daemon, name="finger"), DashboardServer(FormulaSource(), port=0), \
            FoxgloveServer(daemon, name="finger", port=0), \
            Ros2Publisher(daemon, f"tcp/127.0.0.1:{free_port()}", name="finger"):  # fmt: skip
        opened = {family: [one for one in there if one not in before[family]] for family, there in listening().items()}
        assert len(opened["tcp"]) >= 4, opened
        assert all(one.startswith("127.") for one in opened["tcp"]), opened
        assert (opened["tcp6"], opened["udp"], opened["udp6"], opened["unix"]) == ([], [], [], [])
        assert not set(as_stranger("browses", running()[0].endpoint.rpartition(":")[2])) & {"200", "400", "403"}


def listening() -> dict[str, list[str]]:
    """Return what this process listens at: addresses of each family, and the names of unix sockets."""
    own = {one.readlink().name for one in Path("/proc/self/fd").iterdir() if one.is_symlink()}
    found = dict[str, list[str]]()
    for family in ("tcp", "tcp6", "udp", "udp6"):
        rows = [line.split() for line in Path(f"/proc/net/{family}").read_text().splitlines()[1:]]
        mine = [row[1] for row in rows if f"socket:[{row[9]}]" in own and row[3] in ("0A", "07")]  # listens, or is UDP
        found[family] = [_readable(one) for one in mine]
    rows = [line.split() for line in Path("/proc/net/unix").read_text().splitlines()[1:]]
    found["unix"] = [row[7] for row in rows if f"socket:[{row[6]}]" in own and len(row) > 7]
    return found


def _readable(address: str) -> str:
    host, port = address.split(":")
    if len(host) > 8:
        return address
    return f"{socket.inet_ntoa(bytes.fromhex(host)[::-1])}:{int(port, 16)}"


def test_the_page_answers_nobody_without_the_token() -> None:
    with DashboardServer(FormulaSource(), port=0) as server:
        assert set(as_stranger("page", server.base)) == {"401"}
