"""`gellight ring`: the light ring by hand."""

import time
from dataclasses import asdict, replace
from enum import IntEnum
from functools import partial
from typing import Annotated, Any

import numpy as np
import typer

from gellight.base.errors import InputError
from gellight.base.leds import MOST_LEDS
from gellight.cli.ending import until_interrupted
from gellight.cli.lazy import lazy_group
from gellight.cli.options import LONGEST_S, AsJson, Seconds
from gellight.cli.showing import show
from gellight.ring.boards import BOARDS, LEDS, channel_ua_of, check_wiring, find_board, wired_as
from gellight.ring.enumerations import ColourOrder, Dark, OutputAt, ResetReason, SyncMode
from gellight.ring.heat import chip_temperature_c, dimmed_text, ring_temperature_c, warm_text
from gellight.ring.light_ring import LightRing, connect
from gellight.ring.protocol import ACTIVE_LOW, CURRENT_CAP_MA, NO_PIN, Configuration

app = typer.Typer(
    cls=lazy_group(
        {},
        gone={
            "group": "is `gellight ring set COLOUR --leds 0-3,8` now",
            "off": "is `gellight ring set off` now",
            "sequence": "is no more: `gellight run --set lighting.sequence=rgb` shows light groups in turn",
        },
    ),
    help="The light ring by hand.",
    no_args_is_help=True,
)
PINS = ("data", "trigger", "output", "status", "switch")
wiring_option = partial(typer.Option, rich_help_panel="Wiring")
Url = Annotated[str, typer.Option(help="/dev/ttyACM0, serial://, serial://NUMBER or sim://")]


def _wait(lit: str, seconds: float) -> None:
    """Say what is lit, and keep it lit for this long; 0: until Ctrl-C or SIGTERM."""
    with until_interrupted():
        print(lit if seconds else f"{lit}   (Ctrl-C ends and makes the LEDs dark)", flush=True)
        time.sleep(seconds or LONGEST_S)


@app.command("info")
def information(url: Url = "serial://", as_json: AsJson = False) -> None:
    """Show which board it is, what it is doing and what went wrong."""
    with connect(url) as ring:
        board = _board(ring)
    show(board, as_json, _text(board))


def _board(ring: LightRing) -> dict[str, Any]:
    """Return what a board says of itself. `ring_temperature_c`: None where it reads no NTC; `dimmed`: how often every
    colour is halved because chip, ring or housing is hot."""
    hello, status = ring.hello, ring.status()
    return {
        "board": hello.unique_id.hex().upper(),
        "firmware": f"{hello.firmware_major}.{hello.firmware_minor}.{hello.firmware_patch}",
        "image_crc": f"{hello.image_crc:08x}",
        "protocol": f"{hello.protocol_major}.{hello.protocol_minor}",
        "schema_crc": f"{hello.schema_crc:08x}",
        "reset_reason": ResetReason(hello.reset_reason).name,
        "uptime_s": status.time_us / 1e6,
        "temperature_c": chip_temperature_c(status),
        "ring_temperature_c": ring_temperature_c(status),
        "dimmed": status.dimmed,
        "current_ma": status.current_ma,
        "limit_ma": status.limit_ma,
        "dark": Dark(status.dark).name,
        "mode": SyncMode(status.mode).name,
        "running": bool(status.state),
        "counters": asdict(ring.counters()),
    }


def _text(b: dict[str, Any]) -> str:
    counters = b["counters"]
    wrong = {k: v for k, v in counters.items() if v and k not in ("packets", "lights", "triggers")}
    warm = warm_text(b["temperature_c"], b["ring_temperature_c"])
    started = [f"by {b['reset_reason']}, {b['uptime_s']:.1f} s ago", warm]
    light = [f"{b['current_ma']} of {b['limit_ma']} mA, {b['dark']}", dimmed_text(b["dimmed"])]
    return (
        f"board     {b['board']}, firmware {b['firmware']}, image {b['image_crc']}\n"
        f"protocol  {b['protocol']}, schema {b['schema_crc']}\n"
        f"started   {', '.join(filter(None, started))}\n"
        f"light     {', '.join(filter(None, light))}\n"
        f"mode      {b['mode']}, {'running' if b['running'] else 'still'}\n"
        f"counters  {counters['packets']} packets, {counters['lights']} lights, {wrong or 'nothing wrong'}"
    )


@app.command("set")
def set_colour(
    colour: Annotated[
        str, typer.Argument(help="RRGGBB in hexadecimal, or one for each LED, separated by commas; off: dark")
    ],
    leds: Annotated[
        str | None, typer.Option(help="Light these alone, for example 0-3,8.", show_default="all of them")
    ] = None,
    url: Url = "serial://",
    seconds: Seconds = 0,
) -> None:
    """Light the LEDs in one colour, or each in its own."""
    with connect(url) as ring:
        if colour == "off":
            ring.blank()
            print("dark")
            return
        colours = np.array(_colours(colour, ring.led_count), np.uint8)
        if leds is not None:
            dark = np.setdiff1d(np.arange(ring.led_count), _numbers(leds, ring.led_count))
            colours[dark] = 0
        reply = ring.set_leds(colours)
        ring.wait_for_light(reply.light_id)
        scaled = "" if reply.scale == 0xFFFF else f", scaled by {reply.scale / 65535:.3f}"
        _wait(f"lit, {reply.current_ma} mA{scaled}", seconds)


def _colours(text: str, leds: int) -> list[list[int]]:
    words = text.split(",")
    try:
        colours = [bytes.fromhex(word.strip().removeprefix("#")) for word in words]
    except ValueError:
        colours = []
    if len(colours) not in (1, leds) or any(len(colour) != 3 for colour in colours):
        raise InputError(f"{text!r} is no colour: give RRGGBB, for example ff0000, or {leds} of them")
    return [list(colour) for colour in colours] * (leds if len(colours) == 1 else 1)


def _numbers(text: str, leds: int) -> list[int]:
    found: list[int] = []
    try:
        for part in text.split(","):
            first, _, last = part.partition("-")
            found += range(int(first), int(last or first) + 1)
    except ValueError:
        found = []
    if not found or min(found) < 0 or max(found) >= leds:
        raise InputError(f"{text!r} names no LEDs: give numbers from 0 to {leds - 1}, for example 0-3,8")
    return found


@app.command("configure")
def configure(
    board: Annotated[str | None, typer.Option(help=f"preset of the pins: {', '.join(BOARDS)}")] = None,
    pins: Annotated[
        list[str] | None,
        wiring_option(
            "--pin",
            metavar="NAME=GPIO",
            help=f"GPIO of {', '.join(PINS)}; again for another one. 128 more: low lights or closes it; 255: none",
            show_default="none",
        ),
    ] = None,
    supply_ma: Annotated[
        int | None,
        typer.Option(help="current limit of LEDs with a supply of their own, mA, 100 to 2000; 0: USB, 450 mA"),
    ] = None,
    led: Annotated[str | None, typer.Option(help=f"kind of the LEDs, for their current: {', '.join(LEDS)}")] = None,
    hottest: Annotated[
        int | None, typer.Option(help="°C of the chip above which the LEDs are dimmed, 40 to 85")
    ] = None,
    leds: Annotated[int | None, wiring_option(help=f"number of LEDs, 1 to {MOST_LEDS}")] = None,
    order: Annotated[str | None, wiring_option(help="grb (WS2812B), rgb or rgbw (SK6812 RGBW)")] = None,
    output: Annotated[str | None, wiring_option(help="when the output pulses: start, middle or none")] = None,
    url: Url = "serial://",
) -> None:
    """Change what the board remembers without power: its pins and LEDs; then start it anew."""
    with connect(url) as ring:
        changed = ring.configuration()
        if board:
            changed = wired_as(changed, find_board(board), output=output not in (None, "none"))
        given = {"hottest_c": hottest, "led_count": leds, "colour_order": _member(ColourOrder, order)}
        given |= dict(map(_pin, pins or []))
        given |= {"output_pin": NO_PIN} if output == "none" else {"output_at": _member(OutputAt, output)}
        if supply_ma is not None:
            given |= {"external_supply": int(supply_ma > 0), "limit_ma": supply_ma or CURRENT_CAP_MA}
        given["channel_ua"] = None if led is None else channel_ua_of(led)
        for name, value in given.items():
            changed = changed if value is None else replace(changed, **{name: value})  # type: ignore[arg-type]
        check_wiring(changed)
        ring.light(None)
        if supply_ma is not None or led is not None:
            ring.set_supply(external=bool(changed.external_supply), channel_ua=changed.channel_ua)
        ring.configure(changed, save=True)
        ring.reset()
    print(_wiring(changed, board))


def _pin(text: str) -> tuple[str, int]:
    """Return the field of the configuration that NAME=GPIO sets, and its value."""
    name, _, number = text.partition("=")
    if name not in PINS or not number.isdecimal():
        raise InputError(f"--pin {text!r} is no pin: give NAME=GPIO with a name of {', '.join(PINS)}")
    return f"{name}_pin", int(number)


def _member(kind: type[IntEnum], name: str | None) -> int | None:
    names = [member.name.lower() for member in kind]
    if name is not None and name not in names:
        raise InputError(f"{name!r} is none of {', '.join(names)}")
    return None if name is None else int(kind[name.upper()])


def _wiring(c: Configuration, board: str | None) -> str:
    status = "no status LED" if c.status_pin == NO_PIN else f"status LED at GPIO {c.status_pin & ~ACTIVE_LOW}"
    output = "no trigger output"
    if c.output_pin != NO_PIN:
        output = f"trigger output at GPIO {c.output_pin} ({OutputAt(c.output_at).name.lower()} of each light)"
    switch = "" if c.switch_pin == NO_PIN else f", load switch at GPIO {c.switch_pin & ~ACTIVE_LOW}"
    labels = f"; {BOARDS[board].name} prints data, trigger, output as {BOARDS[board].printed}" if board else ""
    return (
        f"saved: {c.led_count} LEDs ({ColourOrder(c.colour_order).name}) at GPIO {c.data_pin}, trigger at GPIO "
        f"{c.trigger_pin}, {output}, {status}{switch}, dimmed above {c.hottest_c} °C{labels}; the board starts anew"
    )
