"""Figures as SVG and PNG, small enough to read and without a plotting library."""

import base64
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from math import ceil, floor, isfinite, log10

import numpy as np
from numpy.typing import ArrayLike, NDArray

SERIES = ("#3b6fd4", "#d6453d", "#3a9d5d", "#b07aa1", "#e08e2b", "#4aa3a8", "#8c6d46", "#7f7f7f", "#5b4fa2", "#c05780")
WIDTH, HEIGHT = 440.0, 280.0
LEFT, RIGHT, TOP, BOTTOM = 52.0, 12.0, 26.0, 40.0


@dataclass(frozen=True)
class Series:
    """A curve: NaN breaks it."""

    label: str
    x: Sequence[float]
    y: Sequence[float]
    dashed: bool = False


@dataclass(frozen=True, kw_only=True)
class Axes:
    """What a chart says along its sides."""

    title: str
    x: str
    y: str
    log: bool = False
    marks: tuple[tuple[float, str], ...] = ()
    """vertical lines: place and label"""


def line_chart(series: Sequence[Series], axes: Axes) -> str:
    """Return curves as SVG."""
    xs = [value for one in series for value in one.x]
    ys = [value for one in series for value in one.y if isfinite(value) and (value > 0 or not axes.log)]
    low, high = _range(ys, axes.log)
    frame = _Frame(min(xs), max(xs), low, high, axes.log)
    body = [_title(axes.title), *_grid(frame, axes)]
    for at, label in axes.marks:
        body.append(f'<path class="mark" d="M{frame.x(at):.1f} {TOP}V{HEIGHT - BOTTOM}"/>')
        body.append(f'<text class="tick" x="{frame.x(at) + 3:.1f}" y="{TOP + 9}">{escape(label)}</text>')
    for number, one in enumerate(series):
        dash = ' stroke-dasharray="5 3"' if one.dashed else ""
        path = _path(frame, one)
        body.append(f'<path d="{path}" fill="none" stroke="{_colour(number)}" stroke-width="1.8"{dash}/>')
    return _figure(body, WIDTH, HEIGHT) + _legend([one.label for one in series])


def heat_map(
    values: ArrayLike, rows: Sequence[str], columns: Sequence[str], title: str, *, largest: float, mark: bool = True
) -> str:
    """Return a matrix as coloured cells, blue at 0 and red from `largest`, each with its number."""
    table = np.asarray(values, dtype=float)
    cell_x, cell_y, left, top = 36.0, 22.0, 30.0, 26.0
    width, height = left + cell_x * len(columns) + 4, top + cell_y * len(rows) + 20
    body = [_title(title)]
    for r, row in enumerate(rows):
        body.append(f'<text class="tick" x="{left - 5}" y="{top + (r + 0.68) * cell_y}" text-anchor="end">{row}</text>')
        for c in range(len(columns)):
            x, y, value = left + c * cell_x, top + r * cell_y, float(table[r, c])
            colour = heat_colour(value / largest)
            ink = "#fff" if not 0.12 < value / largest < 0.85 else "#111"
            best = ' stroke="#111" stroke-width="1.6"' if mark and value == table[r].min() else ""
            body.append(
                f'<rect x="{x}" y="{y}" width="{cell_x - 1}" height="{cell_y - 1}" rx="2" fill="{colour}"{best}/>'
                f'<text class="cell" fill="{ink}" x="{x + cell_x / 2}" y="{y + 14}">{_short(value)}</text>'
            )
    for c, column in enumerate(columns):
        body.append(
            f'<text class="tick" x="{left + (c + 0.5) * cell_x}" y="{height - 6}" text-anchor="middle">{column}</text>'
        )
    return _figure(body, width, height)


def heat_colour(share: float) -> str:
    """Return the colour of 0 (blue) to 1 and above (red), by way of pale yellow."""
    stops = np.array([[49, 96, 180], [116, 173, 209], [224, 243, 248], [254, 224, 144], [244, 109, 67], [165, 15, 38]])
    at = min(max(share, 0.0), 1.0) * (len(stops) - 1)
    left = min(int(at), len(stops) - 2)
    red, green, blue = np.rint(stops[left] + (at - left) * (stops[left + 1] - stops[left])).astype(int).tolist()
    return f"#{red:02x}{green:02x}{blue:02x}"


def picture(image: NDArray[np.uint8], caption: str, width_px: int = 150) -> str:
    """Return (H, W, 3) or (H, W) uint8 as an HTML figure that holds its own PNG."""
    source = base64.b64encode(png(image)).decode()
    return (
        f'<figure style="width:{width_px}px"><img alt="{escape(caption)}" width="{width_px}" '
        f'src="data:image/png;base64,{source}"><figcaption>{escape(caption)}</figcaption></figure>'
    )


def png(image: NDArray[np.uint8]) -> bytes:
    """Return (H, W, 3) or (H, W) uint8 as a PNG file."""
    height, width = image.shape[:2]
    colour = 2 if image.ndim == 3 else 0
    rows = np.concatenate([np.zeros((height, 1), np.uint8), image.reshape(height, -1)], axis=1)
    header = struct.pack(">IIBBBBB", width, height, 8, colour, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes(), 9)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(kind, content) for kind, content in chunks)


def _chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


@dataclass(frozen=True)
class _Frame:
    """From values to places in the drawing."""

    left: float
    right: float
    low: float
    high: float
    log: bool

    def x(self, value: float) -> float:
        return LEFT + (value - self.left) / ((self.right - self.left) or 1) * (WIDTH - LEFT - RIGHT)

    def y(self, value: float) -> float:
        at, low, high = (log10(v) if self.log else v for v in (value, self.low, self.high))
        return HEIGHT - BOTTOM - (at - low) / ((high - low) or 1) * (HEIGHT - TOP - BOTTOM)


def _range(values: Sequence[float], log: bool) -> tuple[float, float]:
    if log:
        low, high = log10(min(values)), log10(max(values))
        return 10 ** (floor(low * 2) / 2), 10 ** (ceil(high * 2) / 2)
    low, high = min(0.0, *values), max(values)
    step = _step(high - low)
    return floor(low / step) * step, ceil(high / step) * step


def _step(span: float) -> float:
    power = 10.0 ** floor(log10(span or 1))
    return next(power * factor for factor in (0.1, 0.2, 0.5, 1, 2) if span / (power * factor) <= 6)


def _ticks(low: float, high: float, log: bool) -> list[float]:
    if log:
        powers = range(floor(log10(low)), ceil(log10(high)) + 1)
        ticks = [factor * 10.0**power for power in powers for factor in (1, 3)]
    else:
        step = _step(high - low)
        ticks = [step * at for at in range(round(low / step), round(high / step) + 1)]
    return [tick for tick in ticks if low * (1 - 1e-9) <= tick <= high * (1 + 1e-9)]


def _grid(frame: _Frame, axes: Axes) -> list[str]:
    body = []
    for tick in _ticks(frame.low, frame.high, axes.log):
        y = frame.y(tick)
        body.append(f'<path class="grid" d="M{LEFT} {y:.1f}H{WIDTH - RIGHT}"/>')
        body.append(f'<text class="tick" x="{LEFT - 5}" y="{y + 3:.1f}" text-anchor="end">{tick:.4g}</text>')
    step = _step(frame.right - frame.left)
    for at in range(ceil(frame.left / step), floor(frame.right / step) + 1):
        x = frame.x(at * step)
        body.append(f'<path class="grid" d="M{x:.1f} {TOP}V{HEIGHT - BOTTOM}"/>')
        body.append(
            f'<text class="tick" x="{x:.1f}" y="{HEIGHT - BOTTOM + 13}" text-anchor="middle">{at * step:.4g}</text>'
        )
    middle_x, middle_y = (LEFT + WIDTH - RIGHT) / 2, (TOP + HEIGHT - BOTTOM) / 2
    body.append(f'<text class="axis" x="{middle_x}" y="{HEIGHT - 8}" text-anchor="middle">{escape(axes.x)}</text>')
    body.append(
        f'<text class="axis" transform="translate(13 {middle_y}) rotate(-90)" text-anchor="middle">{escape(axes.y)}'
        "</text>"
    )
    return body


def _path(frame: _Frame, one: Series) -> str:
    parts, pen = [], "M"
    for x, y in zip(one.x, one.y, strict=True):
        if not isfinite(y) or (frame.log and y <= 0):
            pen = "M"
            continue
        parts.append(f"{pen}{frame.x(x):.1f} {frame.y(y):.1f}")
        pen = "L"
    return "".join(parts)


def _legend(labels: Sequence[str]) -> str:
    entries = [
        f'<span><i style="background:{_colour(number)}"></i>{escape(label)}</span>'
        for number, label in enumerate(labels)
        if label
    ]
    return f'<div class="legend">{"".join(entries)}</div>'


def _colour(number: int) -> str:
    return SERIES[number % len(SERIES)]


def _title(text: str) -> str:
    return f'<text class="title" x="4" y="15">{escape(text)}</text>'


def _short(value: float) -> str:
    return f"{value:.2f}" if value < 9.995 else f"{value:.1f}"


STYLE = (
    "svg{fill:currentColor}text{font:11px system-ui,sans-serif}.title{font-weight:600;font-size:12px}"
    ".tick{font-size:9.5px;opacity:.75}.axis{font-size:10.5px;opacity:.85}.grid{stroke:currentColor;stroke-opacity:.13;fill:none}"
    ".mark{stroke:currentColor;stroke-opacity:.6;stroke-dasharray:3 3}"
    ".cell{font-size:9px;text-anchor:middle}"
)


def _figure(body: list[str], width: float, height: float) -> str:
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" width="{width:g}" '
        f'height="{height:g}"><style>{STYLE}</style>{"".join(body)}</svg>'
    )
