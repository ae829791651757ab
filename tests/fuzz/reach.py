"""Which lines of the product an input reaches, and a small set of inputs that reaches as many."""

import sys
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import gellight
import sim_reference
from tests.fuzz.parser import Parser

OURS = tuple(str(Path(str(package.__file__)).parent) for package in (gellight, sim_reference))
Reached = dict[CodeType, set[int]]
"""lines, by the functions that were entered"""


def reach(parser: Parser, content: bytes) -> Reached:
    """Return what one input reaches, whether it is taken, refused, or fells the parser."""
    reached: Reached = {}

    def trace(frame: FrameType, event: str, _: Any) -> Any:
        if event == "call":
            if not frame.f_code.co_filename.startswith(OURS):
                return None
            reached.setdefault(frame.f_code, set())
        elif event == "line":
            reached[frame.f_code].add(frame.f_lineno)
        return trace

    sys.settrace(trace)
    try:
        with suppress(Exception):
            parser.parse(content)
    finally:
        sys.settrace(None)
    return reached


def adds(reached: Reached, more: Reached) -> bool:
    """Add what another input reaches; return whether anything of it is new."""
    new = any(lines - reached.get(code, set()) for code, lines in more.items())
    for code, lines in more.items():
        reached.setdefault(code, set()).update(lines)
    return new


def smallest(parser: Parser, contents: Iterable[bytes]) -> list[bytes]:
    """Return the inputs, short ones first, that reach a line which those before and the sound ones do not."""
    reached: Reached = {}
    for content in parser.sound:
        adds(reached, reach(parser, content))
    return [
        content for content in sorted(set(contents), key=lambda c: (len(c), c)) if adds(reached, reach(parser, content))
    ]
