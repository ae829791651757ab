"""What a sensor may be called by a user: its name becomes part of file names, of topics and of a service's name."""

import re

from gellight.base.errors import InputError

NAME = "[A-Za-z0-9][A-Za-z0-9_.-]{0,63}"
ALLOWED = "at most 64 letters, digits, '-', '_' and '.', the first a letter or a digit"


def check_name(name: str) -> str:
    """Return `name`; InputError where no sensor can be called so."""
    if not re.fullmatch(NAME, name):
        raise InputError(f"--name {name!r} is not possible: give {ALLOWED}")
    return name
