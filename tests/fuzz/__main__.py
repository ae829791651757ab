"""Fuzz the parsers of bytes from outside, guided by coverage: `python -m tests.fuzz [PARSER ...] --runs N`.

parser.py     what a parser is; random inputs, which need no fuzzer
parsers.py    the table of parsers; of_users.py: those of what users bring and what comes over a network
reach.py      which lines inputs reach
guided.py     the process that atheris runs in

It needs atheris: pip install -e ".[fuzz]". Each parser gets a process of its own, with 2 GB and 10 s an input. What
reaches a new line goes to tests/corpus, and so does what a parser neither takes nor refuses; then it ends with 1.
"""

import argparse
import hashlib
import logging
import os
import re
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.fuzz.parser import Parser
from tests.fuzz.parsers import parsers
from tests.fuzz.reach import smallest

CORPUS = Path(__file__).parents[1] / "corpus"
LONGEST_BYTES, MOST_S, MOST_MB = 16384, 10, 2048
LARGEST_KEPT = 4096
"""bytes: what is longer is not kept"""


def kept(name: str) -> list[Path]:
    """Return the inputs in the corpus for a parser."""
    return sorted(CORPUS.glob(f"{name}-*.bin"))


def keep(name: str, content: bytes) -> None:
    (CORPUS / f"{name}-{hashlib.sha256(content).hexdigest()[:12]}.bin").write_bytes(content)


def fuzz(parser: Parser, runs: int, seed: int, most_s: int) -> bool:
    """Fuzz one parser; print how it went; return whether it stood."""
    with tempfile.TemporaryDirectory() as name:
        folder, found = Path(name) / "corpus", Path(name) / "found"
        for one in (folder, found):
            one.mkdir()
        for number, content in enumerate([*parser.sound, *(path.read_bytes() for path in kept(parser.name))]):
            (folder / str(number)).write_bytes(content)
        options = [f"-runs={runs}", f"-seed={seed}", f"-max_len={LONGEST_BYTES}", f"-timeout={MOST_S}",
                   f"-rss_limit_mb={MOST_MB}", f"-max_total_time={most_s}", f"-artifact_prefix={found}/",
                   "-print_final_stats=1", str(folder)]  # fmt: skip
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        command = [sys.executable, "-m", "tests.fuzz.guided", parser.name, str(found), *options]
        done = subprocess.run(command, capture_output=True, check=False)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        said = done.stderr.decode(errors="replace")
        for path in found.iterdir():
            keep(parser.name, path.read_bytes())
        stood = done.returncode == 0 and not any(found.iterdir())
        for content in smallest(parser, (path.read_bytes() for path in folder.iterdir()) if stood else ()):
            if len(content) <= LARGEST_KEPT:
                keep(parser.name, content)
    executed = re.search(r"stat::number_of_executed_units: *(\d+)", said)
    edges = re.findall(r"cov: (\d+)", said)
    cpu_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    print(f"{parser.name:12} {int(executed[1]) if executed else 0:9} executions, {edges[-1] if edges else 0:>5} edges, "
          f"{cpu_s:6.1f} s", flush=True)  # fmt: skip
    for line in re.findall(r"^FELL (.*)|^(==\d+== ?ERROR.*)", said, re.MULTILINE):
        print("   ", *line, flush=True)
    if done.returncode and not any(found_line in said for found_line in ("FELL", "ERROR")):
        print(said[-2000:])
    return stood


def main() -> int:
    """Fuzz all of them, or those that are named."""
    options = argparse.ArgumentParser("python -m tests.fuzz", description="Fuzz parsers, guided by coverage.")
    options.add_argument("names", nargs="*", metavar="PARSER")
    options.add_argument("--runs", type=int, default=100_000, help="executions for each parser")
    options.add_argument("--seconds", type=int, default=0, help="and at most so long; 0: as long as it takes")
    options.add_argument("--seed", type=int, default=1)
    chosen, stood = options.parse_args(), True
    logging.disable()  # rubbish is what is made here
    with parsers() as known:
        if wrong := set(chosen.names) - {parser.name for parser in known}:
            options.error(f"no parser {', '.join(sorted(wrong))}: choose of {', '.join(one.name for one in known)}")
        for parser in known:
            if chosen.names and parser.name not in chosen.names:
                continue
            if (child := os.fork()) == 0:  # a process inherits the peak of memory of the one that starts it
                os._exit(not fuzz(parser, chosen.runs, chosen.seed, chosen.seconds))
            else:
                stood &= os.waitpid(child, 0)[1] == 0
    return 0 if stood else 1


if __name__ == "__main__":
    sys.exit(main())
