"""Write the C header and the document of the protocol from `gellight.ring.protocol`."""

import re
import struct
from enum import IntEnum, IntFlag
from pathlib import Path

from gellight.base.errors import InputError
from gellight.ring import protocol
from gellight.ring.enumerations import ENUMS
from gellight.ring.wire import Record, layout

HEADER = Path("firmware/core/protocol.h")
DOCUMENT = Path("docs/protocol.md")
COMMAND_LINE = "python firmware/generate.py"


def snake(name: str) -> str:
    """Return `set_leds` of `SetLeds`."""
    return re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()


def header() -> str:
    """Return the text of `protocol.h`."""
    parts = [
        f"/* Generated from host/gellight/ring/protocol.py by `{COMMAND_LINE}`; do not edit. */",
        "#ifndef GELLIGHT_PROTOCOL_H\n#define GELLIGHT_PROTOCOL_H\n\n#include <stdint.h>",
        _constants(),
        *(_enum(enum) for enum in ENUMS),
        _codes(),
        "/* Records lie in packets as they are: little endian, without gaps, at any address. */\n"
        "#define RECORD __attribute__((packed, may_alias))",
        *(_struct(record) for record in protocol.records()),
        _table(),
        "#endif",
    ]
    return "\n\n".join(parts) + "\n"


def _constants() -> str:
    values = {"PROTOCOL_MAJOR": f"{protocol.VERSION[0]}u", "PROTOCOL_MINOR": f"{protocol.VERSION[1]}u",
              "SCHEMA_CRC": f"0x{protocol.schema_crc():08x}u"}  # fmt: skip
    for name, value in protocol.CONSTANTS.items():
        values[name] = f"0x{value:08x}u" if value > 0x10000000 else f"{value}u"
    return "\n".join(f"#define {name} {value}" for name, value in values.items())


def _enum(enum: type[IntEnum] | type[IntFlag]) -> str:
    name = snake(enum.__name__)
    members = "\n".join(f"    {name.upper()}_{m.name} = {m.value}," for m in enum)
    return f"/* {(enum.__doc__ or '').strip()} */\nenum {name} {{\n{members}\n}};"


def _codes() -> str:
    commands = "\n".join(f"    COMMAND_{name} = 0x{e.code:02x}," for name, e in protocol.COMMANDS.items())
    events = "\n".join(f"    EVENT_{name} = 0x{code:02x}," for name, (code, _) in protocol.EVENTS.items())
    return f"enum command {{\n{commands}\n}};\n\nenum event {{\n{events}\n}};"


def _struct(record: type[Record]) -> str:
    rows = []
    for name, scalar, meaning in layout(record):
        field = f"    {scalar.c_type} {name}{f'[{scalar.length}]' if scalar.length else ''};"
        rows.append(f"{field} /* {meaning} */" if meaning else field)
    name, size = snake(record.__name__), record.codec().size
    body = "\n".join(rows)
    return (
        f"/* {(record.__doc__ or '').strip()} */\nstruct RECORD {name} {{\n{body}\n}};\n"
        f'_Static_assert(sizeof(struct {name}) == {size}, "{name}");'
    )


def _table() -> str:
    rows = [f"    X({n}, {n.lower()}, {_size(e.request)}, {_size(e.reply)})" for n, e in protocol.COMMANDS.items()]
    return (
        "/* X(NAME, name, bytes of the request record, bytes of the reply record) for each command */\n"
        "#define COMMANDS(X) \\\n" + " \\\n".join(rows)
    )


def _size(record: type[Record]) -> str:
    return "0u" if record is protocol.Empty else f"sizeof(struct {snake(record.__name__)})"


def document() -> str:
    """Return the text of `protocol.md`."""
    commands = (
        f"| 0x{e.code:02x} | {name} | {_link(e.request)} | {_link(e.reply)} | {e.meaning} |"
        for name, e in protocol.COMMANDS.items()
    )
    events = (f"| 0x{code:02x} | {name} | {_link(record)} |" for name, (code, record) in protocol.EVENTS.items())
    parts = [
        f"<!-- Generated from host/gellight/ring/protocol.py by `{COMMAND_LINE}`; do not edit. -->",
        "# Protocol of the light ring",
        (protocol.__doc__ or "").strip(),
        f"Version {protocol.VERSION[0]}.{protocol.VERSION[1]}, schema 0x{protocol.schema_crc():08x}.",
        "## Commands",
        "\n".join(("| code | command | request | reply | |", "|---|---|---|---|---|", *commands)),
        "## Events",
        "\n".join(("| code | event | record |", "|---|---|---|", *events)),
        "## Records\n\nOffset, type, field, meaning.",
        *(_describe(record) for record in protocol.records()),
        "## Enumerations",
        *(_members(enum) for enum in ENUMS),
        "## Constants",
        _listing([f"{name} {value}" for name, value in protocol.CONSTANTS.items()]),
    ]
    return "\n\n".join(parts) + "\n"


def _link(record: type[Record]) -> str:
    return "" if record is protocol.Empty else f"[{record.__name__}](#{record.__name__.lower()})"


def _describe(record: type[Record]) -> str:
    rows, offset = [], 0
    for name, scalar, meaning in layout(record):
        kind = f"{scalar.c_type}[{scalar.length}]" if scalar.length else scalar.c_type
        rows.append(f"{offset:2} {kind.replace('_t', ''):9} {name:15} {meaning}".rstrip())
        offset += struct.calcsize(f"<{scalar.code}")
    return f"### {record.__name__}\n\n{(record.__doc__ or '').strip()} {offset} bytes.\n\n{_listing(rows)}"


def _listing(rows: list[str]) -> str:
    return "\n".join(("```", *rows, "```"))


def _members(enum: type[IntEnum] | type[IntFlag]) -> str:
    rows = ", ".join(f"`{m.name}` {m.value}" for m in enum)
    return f"**{enum.__name__}.** {(enum.__doc__ or '').strip()} {rows}."


def generate(checkout: Path) -> list[Path]:
    """Write both files into a checkout and return those that changed."""
    if not (checkout / HEADER.parent).is_dir():
        raise InputError(f"{checkout} has no {HEADER.parent}: run this in a checkout of the sources")
    changed = []
    for path, text in ((checkout / HEADER, header()), (checkout / DOCUMENT, document())):
        if not path.is_file() or path.read_text() != text:
            path.parent.mkdir(exist_ok=True)
            path.write_text(text)
            changed.append(path)
    return changed
