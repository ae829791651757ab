"""The frame of a report's page: it needs nothing from outside. What is passed as `body` or a cell is HTML already."""

import base64
from collections.abc import Iterable, Sequence
from html import escape
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from gellight.lab.report.pictures import encode_png


def page(title: str, heading: str, body: str) -> str:
    """Return a whole page in the reports' style."""
    style = files("gellight.lab.report").joinpath("report.css").read_text()
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">'
        f"<title>{escape(title)}</title><style>{style}</style><main><h1>{escape(heading)}</h1>{body}</main></html>\n"
    )


def section(title: str, *body: str) -> str:
    """Return a part of the page under its own heading."""
    return f"<section><h2>{escape(title)}</h2>{''.join(body)}</section>"


def tiles(values: Iterable[tuple[str, str]]) -> str:
    """Return the most important values, each a large text over its meaning; neither is HTML."""
    body = "".join(f"<div><b>{escape(value)}</b><span>{escape(meaning)}</span></div>" for value, meaning in values)
    return f'<section class="tiles">{body}</section>'


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table; `head` may be empty."""
    top = "".join(f"<th>{cell}" for cell in head)
    return f"<table>{f'<tr>{top}' if top else ''}{''.join('<tr>' + cells(row) for row in rows)}</table>"


def cells(row: Sequence[str]) -> str:
    """Return the cells of a row of a table."""
    return "".join(f"<td>{cell}" for cell in row)


def box(kind: str, *body: str) -> str:
    """Return a box: "pictures" side by side, or a "wide" table that scrolls."""
    return f'<div class="{kind}">{"".join(body)}</div>'


def picture(image: NDArray[np.uint8], caption: str, width_px: int = 150) -> str:
    """Return (H, W, 3) RGB or (H, W) grey uint8 as an HTML figure that holds its own PNG."""
    source = base64.b64encode(encode_png(image)).decode()
    return (
        f'<figure style="width:{width_px}px"><img alt="{escape(caption)}" width="{width_px}" '
        f'src="data:image/png;base64,{source}"><figcaption>{escape(caption)}</figcaption></figure>'
    )
