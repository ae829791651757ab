"""Where tactile frames go beside ours: a function of another distribution, named by an entry point `gellight.sinks`.

It is called with the name of the sensor and is a context manager that gives a function of one `TactileFrame`. That is
called with the newest frame, again and again: who is slow gets fewer frames. docs/extending.md has an example.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import entry_points

from gellight.base.errors import StreamError
from gellight.daemon.session import SensorSession
from gellight.stream.frame_thread import sending


@contextmanager
def sent_to(sink: str, daemon: SensorSession, name: str) -> Iterator[None]:
    """Send the frames of a daemon to a sink, as long as the context lasts; StreamError where none has this name."""
    found = entry_points(group="gellight.sinks", name=sink)
    if not found:
        known = ", ".join(sorted(entry_points(group="gellight.sinks").names)) or "none is installed"
        raise StreamError(f"no installed distribution has a sink {sink!r} ({known}): install one, or leave it out")
    with next(iter(found)).load()(name) as send, sending(daemon, sink, send):
        yield
