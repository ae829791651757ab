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
WIDTH, HEIGHT = 372.0, 262.0
LEFT, RIGHT, TOP, BOTTOM = 50.0, 12.0, 26.0, 40.0
LEGEND_ROW, LEGEND_LETTER, LEGEND_LINE = 16.0, 5.9, 24.0
"""height of a row, width of a letter, and of the line before it with its gaps"""
TITLE_LETTER = 7.2


@dataclass(frozen=True)
class Series:
    """A curve: NaN breaks it."""

    label: str
    x: Sequence[float]
    y: Sequence[float]
    dashed: bool = False
    colour: int | None = None
    """number in `SERIES`, by default the curve's place"""


@dataclass(frozen=True, kw_only=True)
class Axes:
    """What a chart says along its sides."""

    title: str
    x: str
    y: str
    log: bool = False
    marks: tuple[tuple[float, str], ...] = ()
    """vertical lines: place and label"""
    levels: tuple[tuple[float, str], ...] = ()
    """horizontal lines: place and label"""
    legend: str = ""
    """what the curves' labels are, said before them"""


def line_chart(series: Sequence[Series], axes: Axes) -> str:
    """Return curves with their legend as SVG."""
    xs = [value for one in series for value in one.x]
    ys = [value for one in series for value in one.y if isfinite(value) and (value > 0 or not axes.log)]
    low, high = _range(ys, axes.log)
    frame = _Frame(min(xs), max(xs), low, high, axes.log)
    body = [_title(axes.title), *_grid(frame, axes), *_marks(frame, axes)]
    for number, one in enumerate(series):
        body.append(f'<path d="{_path(frame, one)}" fill="none" {_stroke(number, one)}/>')
    legend, rows = _legend(series, axes.legend)
    return _figure([*body, *legend], WIDTH, HEIGHT + LEGEND_ROW * rows)


def _marks(frame: "_Frame", axes: Axes) -> list[str]:
    body = []
    for at, label in axes.marks:
        body.append(f'<path class="mark" d="M{frame.x(at):.1f} {TOP}V{HEIGHT - BOTTOM}"/>')
        body.append(f'<text class="tick" x="{frame.x(at) + 3:.1f}" y="{TOP + 9}">{escape(label)}</text>')
    for at, label in axes.levels:
        y = frame.y(at)
        body.append(f'<path class="mark" d="M{LEFT} {y:.1f}H{WIDTH - RIGHT}"/>')
        body.append(
            f'<text class="tick" x="{WIDTH - RIGHT - 3}" y="{y - 3:.1f}" text-anchor="end">{escape(label)}</text>'
        )
    return body


CELL_X, CELL_Y = 29.0, 21.0
CELLS_LEFT, CELLS_TOP, CELLS_BOTTOM = 40.0, 26.0, 34.0


def heat_map(
    values: ArrayLike, rows: Sequence[str], columns: Sequence[str], axes: Axes, *, largest: float, mark: bool = True
) -> str:
    """Return a matrix as coloured cells, blue at 0 and red from `largest`, each with its number.

    `mark` frames the smallest of each row.
    """
    table = np.asarray(values, dtype=float)
    cell_x = max(CELL_X, *(LEGEND_LETTER * len(column) + 4 for column in columns))
    right = CELLS_LEFT + cell_x * len(columns)
    width = max(right + 4, TITLE_LETTER * len(axes.title) + 8)
    bottom = CELLS_TOP + CELL_Y * len(rows)
    body = [_title(axes.title)]
    for r, row in enumerate(rows):
        y = CELLS_TOP + (r + 0.68) * CELL_Y
        body.append(f'<text class="tick" x="{CELLS_LEFT - 5}" y="{y:.1f}" text-anchor="end">{row}</text>')
        for c, value in enumerate(table[r].tolist()):
            at = CELLS_LEFT + c * cell_x, CELLS_TOP + r * CELL_Y
            body.append(_cell(at, cell_x, value, largest, mark and value == table[r].min()))
    for c, column in enumerate(columns):
        x = CELLS_LEFT + (c + 0.5) * cell_x
        body.append(f'<text class="tick" x="{x}" y="{bottom + 12}" text-anchor="middle">{column}</text>')
    middle = (CELLS_LEFT + right) / 2, (CELLS_TOP + bottom) / 2
    return _figure([*body, *_axis_labels(axes, middle, bottom + CELLS_BOTTOM - 6)], width, bottom + CELLS_BOTTOM)


def _cell(at: tuple[float, float], width: float, value: float, largest: float, best: bool) -> str:
    x, y = at
    ink = "#fff" if not 0.12 < value / largest < 0.85 else "#111"
    frame = ' stroke="#111" stroke-width="1.6"' if best else ""
    return (
        f'<rect x="{x:.4g}" y="{y}" width="{width - 1:.4g}" height="{CELL_Y - 1}" rx="2" '
        f'fill="{heat_colour(value / largest)}"{frame}/>'
        f'<text class="cell" fill="{ink}" x="{x + width / 2:.4g}" y="{y + 13.5}">{_short(value)}</text>'
    )


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
    middle = (LEFT + WIDTH - RIGHT) / 2, (TOP + HEIGHT - BOTTOM) / 2
    return [*body, *_axis_labels(axes, middle, HEIGHT - 8)]


def _axis_labels(axes: Axes, middle: tuple[float, float], y: float) -> list[str]:
    return [
        f'<text class="axis" x="{middle[0]}" y="{y}" text-anchor="middle">{escape(axes.x)}</text>',
        f'<text class="axis" transform="translate(13 {middle[1]}) rotate(-90)" text-anchor="middle">{escape(axes.y)}'
        "</text>",
    ]


def _path(frame: _Frame, one: Series) -> str:
    parts, pen = [], "M"
    for x, y in zip(one.x, one.y, strict=True):
        if not isfinite(y) or (frame.log and y <= 0):
            pen = "M"
            continue
        parts.append(f"{pen}{frame.x(x):.1f} {frame.y(y):.1f}")
        pen = "L"
    return "".join(parts)


def _legend(series: Sequence[Series], title: str) -> tuple[list[str], int]:
    """Return the legend under the chart and how many rows it takes; curves without labels have none."""
    if not any(one.label for one in series):
        return [], 0
    body = [f'<text class="axis" x="8" y="{HEIGHT + 10}">{escape(title)}</text>']
    x, row = 8 + LEGEND_LETTER * len(title) + 6 * bool(title), 0
    for number, one in enumerate(series):
        if not one.label:
            continue
        width = LEGEND_LINE + LEGEND_LETTER * len(one.label) + 6
        if x + width > WIDTH and x > 8:
            x, row = 8.0, row + 1
        y = HEIGHT + 10 + LEGEND_ROW * row
        body.append(f'<path d="M{x:.1f} {y - 3.5}h18" {_stroke(number, one)}/>')
        body.append(f'<text class="axis" x="{x + LEGEND_LINE:.1f}" y="{y}">{escape(one.label)}</text>')
        x += width
    return body, row + 1


def _stroke(number: int, one: Series) -> str:
    colour = SERIES[(number if one.colour is None else one.colour) % len(SERIES)]
    return f'stroke="{colour}" stroke-width="1.8"' + (' stroke-dasharray="5 3"' if one.dashed else "")


def _title(text: str) -> str:
    return f'<text class="title" x="4" y="15">{escape(text)}</text>'


def _short(value: float) -> str:
    return f"{value:.2f}" if value < 9.995 else f"{value:.1f}"


STYLE = (
    ".chart{fill:currentColor}.chart text{font:11px system-ui,sans-serif}.chart .title{font-weight:600;font-size:12px}"
    ".chart .tick{font-size:9.5px;opacity:.75}.chart .axis{font-size:10.5px;opacity:.85}"
    ".grid{stroke:currentColor;stroke-opacity:.13;fill:none}"
    ".mark{stroke:currentColor;stroke-opacity:.6;stroke-dasharray:3 3}"
    ".chart .cell{font-size:9px;text-anchor:middle}"
)


def _figure(body: list[str], width: float, height: float) -> str:
    return (
        f'<svg class="chart" xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" width="{width:g}" '
        f'height="{height:g}"><style>{STYLE}</style>{"".join(body)}</svg>'
    )
