"""Pieces of the page: sections, figures, tables, and how tracks and times are written."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from html import escape

import cv2
import numpy as np

from stseg.arrays import Bytes
from stseg.reporting.charts import clock_time
from stseg.reporting.figures import Figure
from stseg.reporting.pictures.colours import hex_colour, track_colour
from stseg.reporting.run_statistics import Span

MOST_ROWS = 2000
"""Greatest number of rows of a table; a note counts the others."""


_MAX_PNG = 400_000
"""Size from which a picture in the page is stored as JPEG, bytes."""


def png_bytes(picture: Bytes) -> bytes:
    """A picture as a PNG file's bytes."""
    _, data = cv2.imencode(".png", picture, [cv2.IMWRITE_PNG_COMPRESSION, 7])
    return bytes(np.asarray(data, np.uint8))


def section(heading: str, *bodies: str) -> str:
    """A section with a heading; nothing where it has no body."""
    body = "\n".join(filter(None, bodies))
    return f"<section>\n<h2>{heading}</h2>\n{body}\n</section>" if body else ""


def note(words: str, kind: str = "note") -> str:
    """A paragraph; the words are HTML."""
    return f'<p class="{kind}">{words}</p>'


def figures(pictures: Sequence[Figure], layout: str) -> str:
    """Pictures with their captions; `layout` is a class of the style sheet."""
    parts = [figure(one) for one in pictures]
    return f'<div class="{layout}">{"".join(parts)}</div>' if parts else ""


def figure(picture: Figure) -> str:
    """A picture with its caption: PNG, but JPEG of photographs, that a page with many cameras stays light."""
    data = png_bytes(picture.picture)
    source = jpeg_uri(picture.picture, 85) if len(data) > _MAX_PNG else _uri("png", data)
    tall, wide = picture.picture.shape[:2]
    words = escape(picture.caption)
    return (
        f'<figure><img width="{wide}" height="{tall}" alt="{words}" src="{source}">'
        f"<figcaption>{words}</figcaption></figure>"
    )


def jpeg_uri(picture: Bytes, quality: int) -> str:
    """A picture as the address of a JPEG inside the page; `quality` is 1..100."""
    _, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return _uri("jpeg", bytes(np.asarray(data, np.uint8)))


def _uri(kind: str, data: bytes) -> str:
    return f"data:image/{kind};base64,{base64.b64encode(data).decode('ascii')}"


def chart(svg: str, caption: str) -> str:
    """A chart with its caption."""
    return f"<figure>{svg}<figcaption>{escape(caption)}</figcaption></figure>"


def table(names: Sequence[str], rows: Iterable[Sequence[str]], total: int) -> str:
    """Rows of HTML cells under names; `total` is how many there would be."""
    head = "".join(f"<th>{escape(name)}</th>" for name in names)
    body = "\n".join(f"<tr>{''.join(f'<td>{cell}</td>' for cell in row)}</tr>" for row in rows)
    rest = note(f"The first {MOST_ROWS} of {total} rows.") if total > MOST_ROWS else ""
    return f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>\n{body}\n</tbody></table></div>{rest}'


def bars(amounts: Sequence[tuple[str, float]], total: float, form: str) -> str:
    """A bar for each amount, as long as its share of the greatest, and its share of the total.

    `form` is how an amount is written, such as "{:.1f} s".
    """
    most = max((amount for _, amount in amounts), default=0.0)
    if most <= 0:
        return ""
    rows = [
        f"<dt>{escape(name)}</dt><dd><i style='width:{60 * amount / most:.1f}%'></i> "
        f"{form.format(amount)} <small>{100 * amount / total:.0f} %</small></dd>"
        for name, amount in amounts
    ]
    return f'<dl class="bars">{"".join(rows)}</dl>'


def swatch(identity: int, name: str = "") -> str:
    """A track's colour and id, and its name if it has one."""
    named = f" {escape(name)}" if name else ""
    return f'<i style="background:{hex_colour(track_colour(identity))}"></i>{identity}{named}'


def when(span: Span, frame: int) -> str:
    """A frame and its time."""
    return f"{frame} <small>{clock_time(frame / span.frame_rate)}</small>"
