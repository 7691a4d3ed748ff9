"""Pieces of HTML for notebooks. Every text is escaped here, so that a name can never become markup."""

from __future__ import annotations

import base64
from html import escape
from typing import TYPE_CHECKING

from lightpath import png

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

PICTURE_SIDE_PX = 360
"""Longest side of pictures in notebooks. Whole holograms would add megabytes to a notebook's file."""


def table(title: str, rows: Iterable[tuple[str, object]]) -> str:
    """Return a table of names and values."""
    lines = "".join(
        f'<tr><td style="text-align:left">{escape(name)}</td><td style="text-align:left">{escape(str(value))}</td></tr>'
        for name, value in rows
    )
    return f"<table><caption><b>{escape(title)}</b></caption>{lines}</table>"


def grid(title: str, heads: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a table with a line of heads."""
    head = "".join(f"<th>{escape(text)}</th>" for text in heads)
    body = "".join("<tr>" + "".join(f"<td>{escape(str(cell))}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><caption><b>{escape(title)}</b></caption><tr>{head}</tr>{body}</table>"


def picture(caption: str, content: bytes) -> str:
    """Return a figure of a PNG, JPEG or TIFF picture, made small."""
    return _figure(caption, png.thumbnail(content, PICTURE_SIDE_PX))


def picture_of_region(caption: str, content: bytes, region: tuple[int, int, int, int]) -> str:
    """Return a figure of a picture, of which only a region x, y, width, height [px] counts: the rest is darkened."""
    outside = " In the dark: light that the picture does not need." if _is_part(content, region) else ""
    return _figure(f"{caption}.{outside}" if outside else caption, png.darkened(content, PICTURE_SIDE_PX, region))


def _is_part(content: bytes, region: tuple[int, int, int, int]) -> bool:
    height_px, width_px = png.decode(content).shape[:2]
    return region != (0, 0, width_px, height_px)


def _figure(caption: str, small: bytes) -> str:
    data = base64.b64encode(small).decode()
    return (
        '<figure style="display:inline-block;margin:4px">'
        f'<img alt="{escape(caption)}" src="data:image/png;base64,{data}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )
