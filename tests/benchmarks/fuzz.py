"""Fuzz every parser of bytes from outside: `python -m tests.benchmarks.fuzz INPUTS [SEED] [NAME...]`.

It prints inputs, failures and inputs a second of each, and writes what felled a parser to tests/corpus.
"""

import hashlib
import sys
import time
from pathlib import Path

from tests.helpers.parsers import parsers, run

CORPUS = Path(__file__).parents[1] / "corpus"


def main(inputs: int, seed: int, names: list[str]) -> None:
    total = 0
    with parsers() as known:
        for parser in known:
            if names and parser.name not in names:
                continue
            errors: dict[str, bytes] = {}

            def note(content: bytes, error: Exception, errors: dict[str, bytes] = errors) -> None:
                place = error.__traceback__
                while place and place.tb_next:
                    place = place.tb_next
                line = f"{type(error).__name__} at line {place.tb_lineno if place else 0}: {str(error)[:80]}"
                if len(errors) < 20:
                    errors.setdefault(line, content)

            begun_s = time.process_time()
            failures = run(parser, inputs, seed, note)
            seconds = time.process_time() - begun_s
            total += inputs
            print(f"{parser.name:12} {inputs} inputs, {failures} failures, {inputs / seconds:.0f} a second", flush=True)
            for line, content in errors.items():
                CORPUS.mkdir(exist_ok=True)
                name = hashlib.sha256(content).hexdigest()[:12]
                (CORPUS / f"{parser.name}-{name}.bin").write_bytes(content)
                print(f"    {name}: {line}", flush=True)
    print(f"{total} inputs in all")


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 1, sys.argv[3:])
