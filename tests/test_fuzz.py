"""No parser of bytes from outside falls over: it takes an input, or refuses it with its own error.

The long run: `python -m tests.benchmarks.fuzz 1000000` (inputs for each parser; what fails is written to tests/corpus).
"""

from pathlib import Path

from tests.helpers.parsers import parsers, run

CORPUS = Path(__file__).parent / "corpus"
"""inputs that a parser once fell over, NAME-anything.bin"""
EXECUTIONS = 400


def test_every_parser_takes_what_is_sound_and_takes_or_refuses_what_is_not() -> None:
    failures = []
    with parsers() as known:
        for parser in known:
            for sound in parser.sound:
                parser.parse(sound)
            run(parser, EXECUTIONS, 1, lambda content, error, name=parser.name: failures.append((name, content, error)))
    assert failures == []


def test_inputs_that_once_felled_a_parser_do_so_no_more() -> None:
    with parsers() as known:
        by_name = {parser.name: parser for parser in known}
        for path in sorted(CORPUS.glob("*.bin")):
            parser = by_name[path.name.split("-")[0]]
            try:
                parser.parse(path.read_bytes())
            except parser.refusals:
                continue


def test_a_parser_that_falls_over_is_noticed() -> None:
    from dataclasses import replace

    with parsers() as known:
        weak = replace(known[0], parse=lambda content: content[5])
        assert run(weak, 200, 1, lambda content, error: None) > 0
