"""Hand one parser to atheris, in a process of its own: arguments are its name, a folder for finds, libFuzzer's options.

Nothing of the product is imported before atheris can look into it.
"""

import sys
from pathlib import Path

import atheris

import gellight  # noqa: F401  (before OpenCV: it limits pictures)

with atheris.instrument_imports(include=["gellight", "sim_reference"], enable_loader_override=False):
    from tests.fuzz.parsers import parsers

MOST_FINDS = 20


def main(name: str, folder: str, *options: str) -> None:
    """Fuzz until atheris ends the process; what falls over is printed, and written to the folder."""
    with parsers() as known:
        (parser,) = [parser for parser in known if parser.name == name]
        finds: set[str] = set()

        def feed(content: bytes) -> None:
            try:
                parser.parse(content)
            except parser.refusals:
                return
            except Exception as error:
                kind = kind_of(error)
                if kind not in finds and len(finds) < MOST_FINDS:
                    finds.add(kind)
                    (Path(folder) / f"fell-{len(finds)}").write_bytes(content)
                    print("FELL", kind, str(error)[:80], file=sys.stderr, flush=True)

        atheris.Setup([sys.argv[0], *options], feed)
        atheris.Fuzz()


def kind_of(error: Exception) -> str:
    """Return where an error was raised, by which failures are told apart."""
    place = error.__traceback__
    while place and place.tb_next:
        place = place.tb_next
    file = Path(place.tb_frame.f_code.co_filename).name if place else "?"
    return f"{type(error).__name__} in {file}, line {place.tb_lineno if place else 0}"


if __name__ == "__main__":
    main(*sys.argv[1:])
