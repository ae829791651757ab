"""Line charts and heat maps as SVG; they take the text colour of the page, light or dark."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from math import ceil, floor, isfinite, log10

import numpy as np
from numpy.typing import ArrayLike

from gellight.lab.report.pictures import round_step

SERIES = ("#3b6fd4", "#d6453d", "#3a9d5d", "#b07aa1", "#e08e2b", "#4aa3a8", "#8c6d46", "#7f7f7f", "#5b4fa2", "#c05780")
HEAT = np.array([[49, 96, 180], [116, 173, 209], [224, 243, 248], [254, 224, 144], [244, 109, 67], [165, 15, 38]])
"""RGB from 0 (blue) to the largest value (red)"""
WIDTH, HEIGHT = 372.0, 262.0
LEFT, RIGHT, TOP, BOTTOM = 50.0, 12.0, 26.0, 40.0
"""margins of a line chart around its grid, px"""
CELL_X, CELL_Y = 29.0, 21.0
CELLS_LEFT, CELLS_TOP, CELLS_BOTTOM = 40.0, 26.0, 34.0
"""margins of a heat map around its cells, px"""
LETTER, TITLE_LETTER = 5.9, 7.2
"""mean widths of a letter, px: SVG does not measure its text"""
LEGEND_ROW, LEGEND_LINE = 16.0, 24.0
MOST_TICKS = 6
STYLE = (
    ".chart{fill:currentColor}.chart text{font:11px system-ui,sans-serif}.chart .title{font-weight:600;font-size:12px}"
    ".chart .tick{font-size:9.5px;opacity:.75}.chart .axis{font-size:10.5px;opacity:.85}"
    ".grid{stroke:currentColor;stroke-opacity:.13;fill:none}"
    ".mark{stroke:currentColor;stroke-opacity:.6;stroke-dasharray:3 3}"
    ".chart .cell{font-size:9px;text-anchor:middle}"
)


@dataclass(frozen=True)
class Series:
    """A curve; it is interrupted where y is NaN, or not positive on a logarithmic axis."""

    label: str
    x: Sequence[float]
    y: Sequence[float]


@dataclass(frozen=True, kw_only=True)
class Axes:
    """Title, labels and reference lines of a chart."""

    title: str
    x: str
    y: str
    log: bool = False
    levels: tuple[tuple[float, str], ...] = ()
    """horizontal lines: y and label"""
    legend: str = ""
    """heading of the legend"""


def line_chart(series: Sequence[Series], axes: Axes) -> str:
    """Return curves with their legend as SVG."""
    xs = [value for one in series for value in one.x]
    ys = [value for one in series for value in one.y if isfinite(value) and (value > 0 or not axes.log)]
    scale = _Scale(min(xs, default=0.0), max(xs, default=1.0), _ticks(ys, axes.log), axes.log)
    body = [*_grid(scale), *_labels(axes, (LEFT, WIDTH - RIGHT), (TOP, HEIGHT - BOTTOM), HEIGHT - 8)]
    for at, label in axes.levels:
        body.append(_line("mark", LEFT, scale.y(at), f"H{WIDTH - RIGHT}"))
        body.append(_text("tick", WIDTH - RIGHT - 3, scale.y(at) - 3, label, "end"))
    for number, one in enumerate(series):
        body.append(f'<path d="{_curve(scale, one)}" fill="none" {_stroke(number)}/>')
    legend, rows = _legend(series, axes.legend)
    return _svg(axes.title, [*body, *legend], WIDTH, HEIGHT + LEGEND_ROW * rows)


def heat_map(values: ArrayLike, rows: Sequence[str], columns: Sequence[str], axes: Axes, *, largest: float) -> str:
    """Return a matrix as coloured cells, blue at 0 and red from `largest`, with numbers, the least of a row framed."""
    table = np.asarray(values, dtype=float)
    cell_x = max(CELL_X, *(LETTER * len(column) + 4 for column in columns))
    right, bottom = CELLS_LEFT + cell_x * len(columns), CELLS_TOP + CELL_Y * len(rows)
    body = _labels(axes, (CELLS_LEFT, right), (CELLS_TOP, bottom), bottom + CELLS_BOTTOM - 6)
    for r, label in enumerate(rows):
        y = CELLS_TOP + r * CELL_Y
        body.append(_text("tick", CELLS_LEFT - 5, y + 0.68 * CELL_Y, label, "end"))
        for c, value in enumerate(table[r].tolist()):
            framed = value == table[r].min()
            body.append(_cell(CELLS_LEFT + c * cell_x, y, cell_x, value, value / largest, framed))
    for c, label in enumerate(columns):
        body.append(_text("tick", CELLS_LEFT + (c + 0.5) * cell_x, bottom + 12, label, "middle"))
    return _svg(axes.title, body, max(right + 4, TITLE_LETTER * len(axes.title) + 8), bottom + CELLS_BOTTOM)


def _cell(x: float, y: float, width: float, value: float, share: float, framed: bool) -> str:
    ink = "#111" if 0.12 < share < 0.85 else "#fff"
    frame = ' stroke="currentColor" stroke-width="1.6"' if framed else ""
    number = f"{value:.2f}" if value < 9.995 else f"{value:.1f}"
    return (
        f'<rect x="{x:.4g}" y="{y:.4g}" width="{width - 1:.4g}" height="{CELL_Y - 1}" rx="2" '
        f'fill="{heat_colour(share)}"{frame}/>'
        f'<text class="cell" fill="{ink}" x="{x + width / 2:.4g}" y="{y + 13.5:.4g}">{number}</text>'
    )


def heat_colour(share: float) -> str:
    """Return the colour of 0 (blue) to 1 and above (red), by way of pale yellow."""
    red, green, blue = (round(np.interp(share, np.linspace(0, 1, len(HEAT)), channel)) for channel in HEAT.T)
    return f"#{red:02x}{green:02x}{blue:02x}"


@dataclass(frozen=True)
class _Scale:
    """From values to places in a line chart, px; y reaches from the first to the last of its ticks."""

    left: float
    right: float
    ticks: list[float]
    log: bool

    def x(self, value: float) -> float:
        return LEFT + (value - self.left) / ((self.right - self.left) or 1) * (WIDTH - LEFT - RIGHT)

    def y(self, value: float) -> float:
        at, low, high = (log10(v) if self.log else v for v in (value, self.ticks[0], self.ticks[-1]))
        return HEIGHT - BOTTOM - (at - low) / ((high - low) or 1) * (HEIGHT - TOP - BOTTOM)


def _ticks(values: Sequence[float], log: bool) -> list[float]:
    """Return round numbers around `values`: 1 and 3 of each decade on a logarithmic axis, else from 0 or below."""
    low, high = min(values, default=1.0), max(values, default=1.0)
    if log:
        ticks = [factor * 10.0**power for power in range(floor(log10(low)), ceil(log10(high)) + 1) for factor in (1, 3)]
        first = max(at for at, tick in enumerate(ticks) if tick <= low * (1 + 1e-9))
        return ticks[first : 1 + min(at for at, tick in enumerate(ticks) if tick >= high * (1 - 1e-9))]
    low = min(low, 0.0)
    step = round_step(high - low, MOST_TICKS)
    return [step * at for at in range(floor(low / step), ceil(high / step) + 1)]


def _grid(scale: _Scale) -> list[str]:
    body, bottom = [], HEIGHT - BOTTOM
    for tick in scale.ticks:
        y = scale.y(tick)
        body += [_line("grid", LEFT, y, f"H{WIDTH - RIGHT}"), _text("tick", LEFT - 5, y + 3, f"{tick:.4g}", "end")]
    step = round_step(scale.right - scale.left, MOST_TICKS)
    for at in range(ceil(scale.left / step), floor(scale.right / step) + 1):
        x = scale.x(at * step)
        body += [_line("grid", x, TOP, f"V{bottom}"), _text("tick", x, bottom + 13, f"{at * step:.4g}", "middle")]
    return body


def _labels(axes: Axes, across: tuple[float, float], down: tuple[float, float], y: float) -> list[str]:
    """Return the title and the labels of the axes in the middle of their sides."""
    return [
        _text("title", 4, 15, axes.title),
        _text("axis", sum(across) / 2, y, axes.x, "middle"),
        f'<text class="axis" transform="translate(13 {sum(down) / 2:.1f}) rotate(-90)" text-anchor="middle">'
        f"{escape(axes.y)}</text>",
    ]


def _curve(scale: _Scale, one: Series) -> str:
    parts, pen = [], "M"
    for x, y in zip(one.x, one.y, strict=True):
        if not isfinite(y) or (scale.log and y <= 0):
            pen = "M"
            continue
        parts.append(f"{pen}{scale.x(x):.1f} {scale.y(y):.1f}")
        pen = "L"
    return "".join(parts)


def _legend(series: Sequence[Series], title: str) -> tuple[list[str], int]:
    """Return the legend under the chart and how many rows it takes; curves without labels have none."""
    if not any(one.label for one in series):
        return [], 0
    body, row = [_text("axis", 8, HEIGHT + 10, title)], 0
    x = 8 + LETTER * len(title) + 6 * bool(title)
    for number, one in enumerate(series):
        if not one.label:
            continue
        width = LEGEND_LINE + LETTER * len(one.label) + 6
        if x + width > WIDTH and x > 8:
            x, row = 8.0, row + 1
        y = HEIGHT + 10 + LEGEND_ROW * row
        body.append(f'<path d="M{x:.1f} {y - 3.5}h18" {_stroke(number)}/>')
        body.append(_text("axis", x + LEGEND_LINE, y, one.label))
        x += width
    return body, row + 1


def _stroke(number: int) -> str:
    return f'stroke="{SERIES[number % len(SERIES)]}" stroke-width="1.8"'


def _line(kind: str, x: float, y: float, to: str) -> str:
    return f'<path class="{kind}" d="M{x:.1f} {y:.1f}{to}"/>'


def _text(kind: str, x: float, y: float, text: str, anchor: str = "start") -> str:
    aligned = "" if anchor == "start" else f' text-anchor="{anchor}"'
    return f'<text class="{kind}" x="{x:.1f}" y="{y:.1f}"{aligned}>{escape(text)}</text>'


def _svg(title: str, body: list[str], width: float, height: float) -> str:
    return (
        f'<svg class="chart" role="img" aria-label="{escape(title)}" xmlns="http://www.w3.org/2000/svg" '
        f'viewBox="0 0 {width:g} {height:g}" width="{width:g}" height="{height:g}"><style>{STYLE}</style>'
        f"{''.join(body)}</svg>"
    )
