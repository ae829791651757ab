"""`gellight.subscribe`: the tactile frames of a daemon in another process, on this computer or another one."""

from __future__ import annotations

import json
import logging
import threading
import time
import weakref
from collections.abc import Collection
from contextlib import suppress
from pathlib import Path
from urllib.parse import quote, unquote

import zenoh
from zenoh.handlers import Callback

from gellight.base.allowed import split_url
from gellight.base.errors import GellightError, InputError, StreamError
from gellight.base.mailbox import Mailbox
from gellight.bundle.bundle import Bundle, unpack_bundle
from gellight.daemon.calls import Calibration, Call, Status
from gellight.frames.frames import TactileFrame
from gellight.frames.measures import MapOnRequest
from gellight.frames.status import SensorStatus
from gellight.stream.network import LAN_PORT, close, found_by_multicast, key, name_of, subscribing_session
from gellight.stream.running import default_daemon, running
from gellight.stream.shared_memory import MappedMemory, OverwrittenError
from gellight.stream.source import BACKLOG, PATIENCE_S, FrameSource
from gellight.stream.wire import decode

logger = logging.getLogger(__name__)
TRANSPORTS = {"zenoh": "tcp", "zenoh+tls": "tls"}
"""of zenoh, by the scheme of a URL"""
LISTENER_S = 2.0
"""that the function of a listener may take at the end"""
LOOK_AGAIN_S = 0.2  # chosen: between two looks for a daemon that is to start
MISTYPED_S = 3.0
"""in which a daemon that was started a moment before says that it starts"""
LOOK_S = 2.0
"""a daemon on the local network says at once what it publishes"""
ANSWER_S = 10.0
"""whoever is there says so"""
CALL_S = 30.0
"""a call that changes the light waits for the board, one that changes the mode until a network is loaded"""


def subscribe(
    target: str = "auto",
    *,
    every: bool = False,
    maps: Collection[str] = (),
    patience_s: float = PATIENCE_S,
    wait_s: float = 0.0,
    config: str | Path | None = None,
    token: str = "",
) -> Subscription:
    """Receive the frames of a daemon that runs in another process (`gellight run`).

    `target` is `auto` (the daemon that was started last from this terminal, else the only one of this user on this
    computer, else the only one on the local network that runs with stream.lan), the name of a sensor, looked for in
    the same way, or `zenoh://HOST[:PORT][/NAME]` on another computer, whose daemon runs with stream.lan; zenoh+tls://
    where it is encrypted.
    every: give every frame and not only the newest. maps: of `MapOnRequest`, `pressure_mpa` and `confidence`: the
    daemon computes them for all who ask and sends them along; what does not come is computed here when it is asked for.
    wait_s: how long a daemon is waited for that is not there, as one that starts now; after `MISTYPED_S` the log says
    which are there, since the name may be a wrong one.
    config: a file of zenoh's own settings, for TLS and access control. token: of a daemon of another computer or user,
    to change something: light, mode, zero, presses; reading needs none. Raises StreamError with the remedy.
    """
    if not target:
        raise InputError("subscribe(''): give auto, the name of a sensor or zenoh://HOST[:PORT][/NAME]")
    path = Path(config) if config is not None else None
    asked = _asked(maps)
    endpoint, name, memory, known = _awaited(target, path, wait_s)
    session = subscribing_session(endpoint, config=path)
    try:
        name = _present(session, name, endpoint)
        return Subscription(
            session, name, memory_path=memory, every=every, asked=asked, patience_s=patience_s, token=token or known
        )
    except BaseException:
        close(session)
        raise


def _asked(maps: Collection[str]) -> tuple[MapOnRequest, ...]:
    unknown = [one for one in maps if one not in tuple(MapOnRequest)]
    if unknown or isinstance(maps, str):
        raise InputError(f"maps={maps!r}: give a list of {', '.join(MapOnRequest)}")
    return tuple(map(MapOnRequest, maps))


class _NobodyThereError(StreamError):
    """No daemon of that name, or none at all, was found."""


def _awaited(target: str, config: Path | None, wait_s: float) -> tuple[str, str, str, str]:
    """Return endpoint, name, memory and token of a daemon; look again where there is none, for `wait_s`."""
    begun_s, told = time.monotonic(), False
    while True:
        try:
            return _found(target, config)
        except _NobodyThereError as error:
            waited_s = time.monotonic() - begun_s
            if waited_s >= wait_s:
                raise
            if waited_s >= MISTYPED_S and not told:
                told = True
                logger.warning("%s; waiting %.0f s more", error, wait_s - waited_s)
            time.sleep(LOOK_AGAIN_S)


def _found(target: str, config: Path | None) -> tuple[str, str, str, str]:
    """Return endpoint, name, memory and token of what `subscribe` is given; all but the first may be empty."""
    if "://" in target:
        return *endpoint_and_name(target), "", ""
    daemons = running()
    there = [daemon for daemon in daemons if target in ("auto", daemon.name)]
    if not there:
        return *_on_the_lan("" if target == "auto" else target, config), "", ""
    if (found := default_daemon(there)) is None:
        raise StreamError(f"several daemons publish: name one of {', '.join(daemon.name for daemon in there)}")
    return found.endpoint, found.name, found.memory, found.token


def _on_the_lan(wanted: str, config: Path | None) -> tuple[str, str]:
    """Return endpoint and name of the only daemon with stream.lan here or elsewhere; `wanted`: its name, or ""."""
    places: list[tuple[str, str]] = []
    for endpoint in found_by_multicast():
        with suppress(StreamError):  # a program of zenoh that is no daemon, or one that lets in nobody
            session = subscribing_session(endpoint, config=config)
            try:
                places += [(endpoint, name) for name in present(session) if wanted in ("", name)]
            finally:
                close(session)
    if len(places) == 1:
        return places[0]
    here = ", ".join(daemon.name for daemon in running())
    if places:
        urls = ", ".join(f"zenoh://{place.partition('/')[2]}/{quote(name)}" for place, name in places)
        raise StreamError(f"several daemons publish on the local network: give one of {urls}")
    there = f"there are {here}" if here else "start one with `gellight run`, elsewhere with --set stream.lan=true"
    raise _NobodyThereError(
        f"no daemon publishes {wanted or 'a sensor'} here or, with stream.lan, on the local network: {there}"
    )


def present(session: zenoh.Session, pattern: str = "gellight/*/alive", timeout_s: float = LOOK_S) -> list[str]:
    """Return the names of the sensors that the other side of a session publishes."""
    replies = session.liveliness().get(pattern, timeout=timeout_s)
    return sorted({name_of(str(reply.ok.key_expr)) for reply in replies if reply.ok})


def endpoint_and_name(url: str) -> tuple[str, str]:
    """Return endpoint and name, which may be empty, of a URL."""
    parts = split_url(url)
    try:
        port = parts.port or LAN_PORT
    except ValueError:
        port = 0
    if parts.scheme not in TRANSPORTS or not parts.hostname or not port:
        raise InputError(f"{url} names no daemon: give auto, the name of a sensor or zenoh://HOST[:PORT][/NAME]")
    host = f"[{parts.hostname}]" if ":" in parts.hostname else parts.hostname
    return f"{TRANSPORTS[parts.scheme]}/{host}:{port}", unquote(parts.path.strip("/"))


def read_status(content: bytes, name: str) -> SensorStatus:
    """Return the status that the daemon of `name` answered; StreamError where it is none."""
    try:
        status: SensorStatus = json.loads(content)
    except (ValueError, RecursionError) as error:
        raise StreamError(
            f"what answers as {name} gives no status ({error}): is it a daemon of this version?"
        ) from None
    if not isinstance(status, dict):
        raise StreamError(f"what answers as {name} gives no status: is it a daemon of this version?")
    return status


def _present(session: zenoh.Session, name: str, endpoint: str) -> str:
    """Return the name of the daemon that is there; StreamError where it is not, or where several are."""
    pattern = key(name, "alive") if name else "gellight/*/alive"
    names = present(session, pattern, ANSWER_S)
    if len(names) != 1:
        there = f"there are {', '.join(names)}: pass one name" if names else "start it with `gellight run`"
        raise StreamError(f"no one daemon of {name or 'a sensor'} is at {endpoint}: {there}")
    return names[0]


def _mapped(memory: str) -> MappedMemory | None:
    """Return the memory of a daemon; None where it has none, or keeps it from this program, as a container may."""
    try:
        return MappedMemory(memory) if memory else None
    except OSError as error:
        logger.info("frames come over the network: %s", error)
        return None


class _Inbox:
    """What zenoh calls when messages come, and holds: it knows nothing of the subscription, which can be dropped."""

    def __init__(self, name: str, memory: MappedMemory | None, *, every: bool) -> None:
        self._name, self._memory, self._every = name, memory, every
        self._messages: Mailbox[zenoh.ZBytes | bytes] = Mailbox(BACKLOG if every else 1)
        self._number = 0

    def note_frame(self, sample: zenoh.Sample) -> None:
        with suppress(OverwrittenError):  # in memory, what waits for its turn would be written over
            self._messages.put(self._content(sample.payload) if self._every else sample.payload)

    def note_presence(self, sample: zenoh.Sample) -> None:
        if sample.kind == zenoh.SampleKind.DELETE:
            self.close(f"the daemon of {self._name} has ended: start it again, and subscribe anew")

    def take(self, timeout_s: float) -> bytes:
        """Wait for a message that was not taken yet; TimeoutError, or StreamError after `close`."""
        while True:
            self._number, payload = self._messages.take(self._number, timeout_s)
            with suppress(OverwrittenError):
                return payload if isinstance(payload, bytes) else self._content(payload)

    def _content(self, payload: zenoh.ZBytes) -> bytes:
        content = payload.to_bytes()
        return self._memory.read(content) if self._memory else content

    def close(self, why: str) -> None:
        """Let who waits for messages raise StreamError."""
        self._messages.close(StreamError(why))


def _end(session: zenoh.Session, inbox: _Inbox, listening: list[threading.Thread], memory: MappedMemory | None) -> None:
    """End a subscription: first who waits for frames, then the session, then the memory that both read."""
    inbox.close("the subscription was closed")
    for thread in listening:
        if thread is not threading.current_thread():
            thread.join(LISTENER_S)
    close(session)
    if memory:
        memory.close()


def _ignore(sample: zenoh.Sample) -> None:
    """Take what nobody sends: who subscribes to `want/MAP` asks for that map."""


class Subscription(FrameSource):
    """The frames of one sensor from another process."""

    def __init__(
        self,
        session: zenoh.Session,
        name: str,
        *,
        memory_path: str,
        every: bool,
        asked: Collection[MapOnRequest] = (),
        patience_s: float,
        token: str = "",
    ) -> None:
        """Take over `session`, which is connected to the daemon of the sensor `name`; see `RunningDaemon.memory`."""
        super().__init__(patience_s=patience_s, every=every)
        self.name, self._session, self._token = name, session, token
        memory = _mapped(memory_path)
        self._inbox = inbox = _Inbox(name, memory, every=every)
        self._bundles: dict[str, Bundle] = {}
        # Called in zenoh's own threads: the interpreter would wait at its end for those that zenoh makes for Python.
        note_frame, note_presence, nothing = (
            Callback(note, indirect=False) for note in (inbox.note_frame, inbox.note_presence, _ignore)
        )
        wishes = [session.declare_subscriber(key(name, f"want/{one}"), nothing) for one in asked]
        frames = session.declare_subscriber(key(name, "note" if memory else "frame"), note_frame)
        # Without its history zenoh does not tell a client that a daemon was killed which was there before.
        presence = session.liveliness().declare_subscriber(key(name, "alive"), note_presence, history=True)
        self._held = wishes, frames, presence
        # For programs that do not close it.
        self._ended = weakref.finalize(self, _end, session, inbox, self._listening, memory)

    def _take(self, timeout_s: float) -> TactileFrame:
        return decode(self._inbox.take(timeout_s), self._bundle_of)

    def _why_none(self) -> str:
        try:
            return str(self.status()["error"] or "the daemon is there and publishes none; see its log")
        except GellightError as error:
            return str(error)

    def _release_all(self) -> None:
        self._ended()

    def _ask(self, call: Call) -> bytes:
        try:
            token = None if call.reads else self._token
            asked = self._session.get(
                key(self.name, "call"), payload=call.model_dump_json(), attachment=token, timeout=CALL_S
            )
            replies = list(asked)
        except zenoh.ZError as error:
            raise StreamError(f"the daemon of {self.name} cannot be asked ({error}): subscribe anew") from error
        if not replies:
            raise StreamError(f"the daemon of {self.name} does not answer: is it still there?")
        if replies[0].ok is None:
            said = replies[0].err.payload.to_string() if replies[0].err else "the call failed"
            if said == "Timeout":  # zenoh's own word
                raise StreamError(f"the daemon of {self.name} did not answer within {CALL_S:g} s: is its machine busy?")
            raise InputError(said)
        return replies[0].ok.payload.to_bytes()

    def status(self) -> SensorStatus:
        """Return `SensorSession.status` of the daemon."""
        return read_status(self._ask(Status()), self.name)

    @property
    def bundle(self) -> Bundle:
        """The calibration bundle in use, with the zero in use, fetched from the daemon."""
        return unpack_bundle(self._ask(Calibration()), f"the bundle of {self.name}")

    def _bundle_of(self, zero: str) -> Bundle:
        if zero not in self._bundles:
            self._bundles = {bundle.identity: bundle for bundle in [self.bundle]}
        if zero not in self._bundles:
            raise StreamError("the zero has changed since this frame was taken: ask for the difference image at once")
        return self._bundles[zero]
