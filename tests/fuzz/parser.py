"""`Parser`: what is fuzzed; and inputs that are a little or very wrong."""

import random
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

TOKENS = (b"\0", b"\xff" * 4, b"\x7f\xff\xff\xff", b"-1", b"1e999", b"null", b"[" * 200, b'"', b"{}", b"\xed\xa0\x80")


@dataclass(frozen=True)
class Parser:
    name: str
    parse: Callable[[bytes], object]
    sound: tuple[bytes, ...]
    """what it takes"""
    refusals: tuple[type[Exception], ...]
    """the errors by which it may refuse"""


def by_file(folder: Path, suffix: str, read: Callable[[Path], object]) -> Callable[[bytes], object]:
    """Return a parser of what `read` takes from a file."""
    path = folder / f"fuzzed{suffix}"

    def parse(content: bytes) -> object:
        path.write_bytes(content)
        return read(path)

    return parse


def mutated(sound: bytes, draw: random.Random) -> bytes:
    """Return an input that is a little or very wrong."""
    content = bytearray(sound)
    for _ in range(draw.choice((1, 1, 2, 4, 16))):
        place, kind = draw.randrange(len(content) + 1), draw.randrange(7)
        if kind == 0 and content:
            content[place % len(content)] ^= 1 << draw.randrange(8)
        elif kind == 1 and content:
            content[place % len(content)] = draw.randrange(256)
        elif kind == 2:
            del content[place : place + draw.choice((1, 4, 64, len(content)))]
        elif kind == 3:
            content[place:place] = draw.choice(TOKENS)
        elif kind == 4:
            content[place:place] = content[place : place + draw.randrange(1, 64)]
        elif kind == 5:
            token = draw.choice(TOKENS)
            content[place : place + len(token)] = token
        else:
            content[place:place] = draw.randbytes(draw.randrange(1, 16))
    return bytes(content)


def run(parser: Parser, executions: int, seed: int, failed: Callable[[bytes, Exception], Any]) -> int:
    """Feed a parser inputs; `failed` gets each one that it neither takes nor refuses. Return the failures."""
    draw, failures = random.Random(seed), 0
    for _ in range(executions):
        content = mutated(draw.choice(parser.sound), draw)
        try:
            parser.parse(content)
        except parser.refusals:
            continue
        except Exception as error:
            failures += 1
            failed(content, error)
    return failures
