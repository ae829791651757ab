"""Publishes the frames of a running daemon to other programs, and answers their calls.

A thread of its own takes the newest frame and sends it, as long as somebody subscribes. Who reads too slowly, or not at
all, loses frames and slows neither the sensor nor the other readers. Readers on this computer get a note of where the
frame lies in memory that they share, others the frame itself over the network.
"""

import hmac
import logging
import secrets
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Self
from urllib.parse import urlsplit

import zenoh

from gellight.base.errors import GellightError, InputError
from gellight.daemon.calls import MOST_CALL, Commands, read_call
from gellight.daemon.session import SensorSession
from gellight.frames.camera import Camera
from gellight.frames.frames import TactileFrame
from gellight.frames.measures import MapOnRequest
from gellight.stream.frame_thread import POLL_S, sending
from gellight.stream.network import close, free_lan_port, key, publishing_session
from gellight.stream.running import RunningDaemon, announced
from gellight.stream.shared_memory import FrameMemory
from gellight.stream.wire import encoded

logger = logging.getLogger(__name__)
AT_ONCE = 2
"""calls of a kind that are carried out: an object can be released while another press is computed"""
MOST_WAITING = 16
"""calls that are not answered yet, of either kind; those beyond are refused"""


def own_name(camera: Camera) -> str:
    """Return the serial number or USB port of a real sensor; empty for others, of which there may be several."""
    return str(camera.status().get("name", ""))


def name_of_sensor(camera: Camera) -> str:
    """Return the name that a sensor has for other programs, unless another one is given."""
    return own_name(camera) or urlsplit(camera.url).scheme or "images"


class Publisher:
    """Publishes a daemon that was started; a context manager."""

    def __init__(
        self,
        daemon: SensorSession,
        *,
        name: str = "",
        lan: bool = False,
        config: Path | None = None,
        token: str = "",
        page: str = "",
    ) -> None:
        """Publish `daemon` under `name`, by default that of its sensor; lan, config: see `network.publishing_session`.

        token: what who changes something has to bring; by default one is drawn. page: address of the dashboard, with
        its token. Programs of this user find both.
        """
        self._daemon, self._asked, self._lan, self._config, self._page = daemon, name, lan, config, page
        self._calls = Commands(daemon)
        self.token = token or secrets.token_urlsafe(24)
        self._until = ExitStack()
        self._wanted, self._read_parts = threading.Event(), set[str]()
        self._noting = threading.Lock()
        """zenoh calls each listener in a thread of its own"""
        self._maps = set[MapOnRequest]()
        """that somebody asks for"""
        self._memory: FrameMemory | None = None
        self._held: tuple[object, ...] = ()
        """zenoh withdraws what nobody holds"""
        self.name = ""
        """under which it is published"""
        self.lan_port = 0
        """where other computers connect to; 0: they cannot"""
        self.frames = 0
        """that were published"""

    def __enter__(self) -> Self:
        """Announce the sensor and start; raises StreamError, and then nothing is left behind."""
        with ExitStack() as stack:
            self.lan_port = free_lan_port() if self._lan else 0
            session, endpoint = publishing_session(lan=self._lan, config=self._config, lan_port=self.lan_port)
            stack.callback(close, session)
            self._memory = self._shared(stack)
            self.name = name = stack.enter_context(self._announced(endpoint)).name
            self._publishers = {part: self._publisher(session, part, self._note_readers) for part in ("frame", "note")}
            wishes = [self._publisher(session, f"want/{one}", self._note_wish) for one in MapOnRequest]
            self._questions, self._commands = (_Queue(kind) for kind in ("questions", "commands"))
            for queue in (self._questions, self._commands):
                stack.callback(queue.close)
            calls = session.declare_queryable(key(name, "call"), self._take_call)
            self._held = wishes, calls, session.liveliness().declare_token(key(name, "alive"))
            stack.enter_context(sending(self._daemon, "publish", self._send, lambda: self._wanted.wait(POLL_S)))
            self._until = stack.pop_all()
        return self

    def __exit__(self, *problem: object) -> None:
        """Stop publishing; readers learn that the daemon is gone."""
        self._until.close()

    def _shared(self, stack: ExitStack) -> FrameMemory | None:
        """Return memory for readers on this computer; None where the system has none: they use the network."""
        with suppress(OSError):
            memory = FrameMemory()
            stack.callback(memory.close)
            return memory
        return None

    def _publisher(
        self, session: zenoh.Session, part: str, note: Callable[[str, zenoh.MatchingStatus], None]
    ) -> zenoh.Publisher:
        publisher = session.declare_publisher(
            key(self.name, part), congestion_control=zenoh.CongestionControl.DROP, encoding="application/x-gellight"
        )
        publisher.declare_matching_listener(partial(note, part))
        return publisher

    def _announced(self, endpoint: str) -> AbstractContextManager[RunningDaemon]:
        camera = self._daemon.camera
        numbered = not (self._asked or own_name(camera))
        memory = self._memory.path if self._memory else ""
        name = self._asked or name_of_sensor(camera)
        return announced(
            name, endpoint, camera.url, memory=memory, token=self.token, page=self._page, numbered=numbered
        )

    def _note_readers(self, part: str, status: zenoh.MatchingStatus) -> None:
        with self._noting:
            (self._read_parts.add if status.matching else self._read_parts.discard)(part)
            (self._wanted.set if self._read_parts else self._wanted.clear)()

    def _note_wish(self, part: str, status: zenoh.MatchingStatus) -> None:
        """Note which maps somebody asks for by subscribing to `want/MAP`, where nothing is ever sent."""
        (self._maps.add if status.matching else self._maps.discard)(MapOnRequest(part.removeprefix("want/")))

    def _send(self, frame: TactileFrame) -> None:
        pieces = encoded(frame, tuple(self._maps))
        if "note" in self._read_parts:
            self._publishers["note"].put(self._noted(pieces))
        if "frame" in self._read_parts:
            self._publishers["frame"].put(b"".join(pieces))
        self.frames += 1

    def _noted(self, pieces: Sequence[bytes | memoryview]) -> bytes:
        """Return a note of the frame, or the frame itself where there is no memory for it."""
        try:
            return self._memory.write(pieces) if self._memory else b"".join(pieces)
        except OSError as error:
            logger.warning("no shared memory (%s): a frame goes over the network", error.strerror)
            return b"".join(pieces)

    def _check(self, brought: zenoh.ZBytes | None) -> None:
        """Raise InputError where no token came with a call, or another one."""
        if not hmac.compare_digest(brought.to_bytes() if brought else b"", self.token.encode()):
            raise InputError(
                f"{self.name} may be read by every program, and changed by those that bring its token: `gellight run` "
                "prints it with stream.lan, and takes it from stream.token; give it as subscribe(..., token=...)"
            )

    def _take_call(self, query: zenoh.Query) -> None:
        """Let a call wait for its turn, or refuse it: who has no token cannot make those wait who have it."""
        with _answering(query):
            content = query.payload.to_bytes() if query.payload and len(query.payload) <= MOST_CALL else b""
            call = read_call(content)
            if not call.reads:
                self._check(query.attachment)
            (self._questions if call.reads else self._commands).put(partial(_answer, query, self._calls.take(call)))


def _answer(query: zenoh.Query, carry_out: Callable[[], bytes]) -> None:
    with query, _answering(query):
        query.reply(query.key_expr, carry_out())


class _Queue:
    """Calls that wait for their turn, in threads of their own; few of them wait."""

    def __init__(self, kind: str) -> None:
        self._worker = ThreadPoolExecutor(AT_ONCE, thread_name_prefix=kind)
        self._room = threading.BoundedSemaphore(MOST_WAITING)

    def put(self, work: Callable[[], None]) -> None:
        """Carry `work` out when it is its turn; InputError where too much waits already."""
        if not self._room.acquire(blocking=False):
            raise InputError(f"{MOST_WAITING} calls wait for their answers already: ask again in a moment")
        with suppress(RuntimeError):  # the publisher ends: nobody waits for this answer
            self._worker.submit(work).add_done_callback(lambda _: self._room.release())

    def close(self) -> None:
        """End, without what waits."""
        self._worker.shutdown(wait=True, cancel_futures=True)


@contextmanager
def _answering(query: zenoh.Query) -> Iterator[None]:
    """Answer what goes wrong with the reason."""
    try:
        yield
    except (GellightError, ValueError) as error:
        query.reply_err(str(error))
    except Exception:
        logger.exception("a call failed")
        query.reply_err("the call failed in the daemon; its log says why")
