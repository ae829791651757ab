"""Where a user's running programs find each other: a folder that belongs to that user alone."""

import os
import secrets
import tempfile
from contextlib import suppress
from pathlib import Path

import platformdirs


def folder() -> Path:
    """Return where the files are: a folder that belongs to this user alone."""
    runtime = os.environ.get("XDG_RUNTIME_DIR")  # not there for a user who has not logged in, such as a service
    return Path(runtime) / "gellight" if runtime else platformdirs.user_state_path("gellight") / "running"


def own_token() -> str:
    """Return the token of this user's pages, from a file that nobody else can read; a new one where it cannot be kept.

    It stays the same, so that an open page finds a daemon that was started anew.
    """
    token, place = secrets.token_urlsafe(24), folder() / "page.token"
    with suppress(OSError):
        place.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile("w", dir=place.parent) as drawn:  # which its owner alone can read
            drawn.write(token)
            drawn.flush()
            with suppress(FileExistsError):
                os.link(drawn.name, place)
        return place.read_text()
    return token
