"""Fuzz every parser of bytes from outside: `python -m tests.benchmarks.fuzz INPUTS [SEED] [NAME...] 2>/dev/null`.

Each parser gets rounds of 10 000 inputs, each round with a seed of its own, until it had INPUTS. After each round it
prints inputs, failures and inputs a second of processor time so far. What felled a parser is written to tests/corpus.
Where the process ends in the middle of a round, as C may end it, the last line names the round. Image decoders complain
on stderr.
"""

import hashlib
import sys
import time
from collections.abc import Callable
from pathlib import Path

from tests.helpers.parsers import Parser, parsers, run

CORPUS = Path(__file__).parents[1] / "corpus"
ROUND = 10_000
MOST_FINDS = 20


def noting(name: str, found: dict[str, bytes]) -> Callable[[bytes, Exception], None]:
    """Return what keeps one input for each kind of failure, in `found` and in the corpus."""

    def note(content: bytes, error: Exception) -> None:
        place = error.__traceback__
        while place and place.tb_next:
            place = place.tb_next
        line = f"{type(error).__name__} at line {place.tb_lineno if place else 0}: {str(error)[:80]}"
        if len(found) < MOST_FINDS and line not in found:
            found[line] = content
            CORPUS.mkdir(exist_ok=True)
            digest = hashlib.sha256(content).hexdigest()[:12]
            (CORPUS / f"{name}-{digest}.bin").write_bytes(content)
            print(f"    {digest}: {line}", flush=True)

    return note


def fuzz(parser: Parser, inputs: int, seed: int) -> None:
    """Run rounds until the parser had that many inputs; print how many it had after each."""
    note, done, failures, begun_s = noting(parser.name, {}), 0, 0, time.process_time()
    while done < inputs:
        count = min(ROUND, inputs - done)
        print(f"{parser.name:12} round {done // ROUND} of seed {seed}", end="\r", flush=True)
        failures += run(parser, count, seed * 1_000_003 + done // ROUND, note)
        done += count
        speed = done / (time.process_time() - begun_s)
        print(f"{parser.name:12} {done:9} inputs, {failures} failures, {speed:6.0f} a second", flush=True)


def main() -> None:
    """Fuzz all of them, or those that are named."""
    inputs, seed = (int(sys.argv[at]) if len(sys.argv) > at else 1 for at in (1, 2))
    with parsers() as known:
        for parser in known:
            if not sys.argv[3:] or parser.name in sys.argv[3:]:
                fuzz(parser, inputs, seed)


if __name__ == "__main__":
    main()
