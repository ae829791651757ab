"""No parser of bytes from outside falls over: it takes an input, or refuses it with its own error.

The long run, guided by coverage: `python -m tests.fuzz` (see there); what it finds is written to tests/corpus.
"""

from pathlib import Path

from tests.fuzz.parser import run
from tests.fuzz.parsers import parsers

CORPUS = Path(__file__).parent / "corpus"
"""inputs that a parser once fell over, or that reach a line which no other does: NAME-anything.bin"""
LARGEST_CORPUS = 300_000
EXECUTIONS = 250


def test_every_parser_takes_what_is_sound_and_takes_or_refuses_what_is_not() -> None:
    failures = []
    with parsers() as known:
        for parser in known:
            for sound in parser.sound:
                parser.parse(sound)
            run(parser, EXECUTIONS, 1, lambda content, error, name=parser.name: failures.append((name, content, error)))
    assert failures == []


def test_no_parser_falls_over_an_input_of_the_corpus() -> None:
    with parsers() as known:
        by_name = {parser.name: parser for parser in known}
        for path in sorted(CORPUS.glob("*.bin")):
            parser = by_name[path.name.rpartition("-")[0]]
            try:
                parser.parse(path.read_bytes())
            except parser.refusals:
                continue


def test_a_parser_that_falls_over_is_noticed() -> None:
    from dataclasses import replace

    with parsers() as known:
        weak = replace(known[0], parse=lambda content: content[5])
        assert run(weak, 200, 1, lambda content, error: None) > 0


def test_the_corpus_is_small_and_each_of_it_has_its_parser() -> None:
    files = list(CORPUS.iterdir())
    assert sum(path.stat().st_size for path in files) < LARGEST_CORPUS
    with parsers() as known:
        assert {path.name.rpartition("-")[0] for path in files} <= {parser.name for parser in known}
