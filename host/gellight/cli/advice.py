"""Advice that can be typed as it stands, wherever `gellight` was installed.

Messages name commands as `gellight ...`. In a virtual environment that is not activated the shell does not find
`gellight`, and sudo searches a path of its own, on which it never is.
"""

import os
import re
import shlex
import shutil
import sys
from pathlib import Path

NAME = "gellight"


def program() -> Path:
    """Return the absolute path of the program that runs; NAME alone where it has no file of its own."""
    started = Path(sys.argv[0])
    beside = Path(sys.executable).with_name(NAME)
    for place in (started if started.name == NAME else beside, beside):
        if place.is_file() and os.access(place, os.X_OK):
            return place.absolute()
    return Path(shutil.which(NAME) or NAME)


def activation() -> str:
    """Return how the shell comes to find `gellight`, in one line; empty where it does, or where that is not known."""
    activate = program().with_name("activate")
    if shutil.which(NAME) or not activate.is_file():
        return ""
    here = Path.cwd()
    place = activate.relative_to(here) if activate.is_relative_to(here) else activate
    return f"`. {shlex.quote(str(place))}` puts {NAME} on the PATH of this shell; `{NAME} --help` shows what it can do"


def with_program_path(text: str) -> str:
    """Return a message whose commands in backquotes name `gellight` so that the shell, or sudo, finds it."""
    if f"`{NAME} " not in text and f"sudo {NAME} " not in text:
        return text
    path = program()
    on_path = shutil.which(NAME)
    short = NAME if on_path and Path(on_path).absolute() == path else shlex.quote(str(path))
    text = re.sub(rf"\bsudo {NAME}(?= )", lambda _: f"sudo {shlex.quote(str(path))}", text)
    return re.sub(rf"`{NAME}(?= )", lambda _: f"`{short}", text)
