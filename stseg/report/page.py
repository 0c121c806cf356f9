"""The report as one HTML page that needs nothing else: pictures, charts and style are inside, and nothing is loaded."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape

import cv2
import numpy as np

from stseg.arrays import Bytes, Rows
from stseg.report.charts import Span, clock_time, lives_chart, people_chart
from stseg.report.colours import hex_colour, track_colour
from stseg.report.figures import Figure
from stseg.report.style import STYLE

_MOST_ROWS = 2000  # of a table


@dataclass(frozen=True)
class Contents:
    """What the page tells.

    Attributes
    ----------
    title
    facts
        Names and values, at the top.
    span
        The frames of the run.
    trajectory : TRAJECTORY (n,)
    tracks : TRACK (m,)
    events : EVENT (k,)
    candidates
        Rows with frame and status (1 true, 0 ghost), see CANDIDATE.
    truth : (t,) with frame, or None
    ground, slices, cameras
        Figures of these sections; a section without figures is left out.
    has_images
        Whether the cameras' figures show camera images: the page says so.
    """

    title: str
    facts: Sequence[tuple[str, str]]
    span: Span
    trajectory: Rows
    tracks: Rows
    events: Rows
    candidates: Rows
    truth: Rows | None
    ground: Sequence[Figure]
    slices: Sequence[Figure]
    cameras: Sequence[Figure]
    has_images: bool


def report_page(contents: Contents) -> str:
    """The page's text. The same contents give the same text."""
    span, tracks = contents.span, contents.tracks
    counted = "people in each frame" + ("" if contents.truth is None else "; dashed: the truth")
    sections = [
        _section("On the ground", _figures(contents.ground, "pair")),
        _section("People over time", _chart(people_chart(span, contents.trajectory, contents.truth), counted)),
        _section("Tracks", _chart(lives_chart(span, tracks), "from first frame to last") + _track_table(span, tracks)),
        _section("Events", _event_summary(contents) + _event_table(span, contents.events)),
        _section("Occupancy", _figures(contents.slices, "sheets")),
        _section("Cameras", _privacy(contents) + _figures(contents.cameras, "pair")) if contents.cameras else "",
    ]
    facts = "".join(f"<div><dt>{escape(name)}</dt><dd>{escape(value)}</dd></div>" for name, value in contents.facts)
    return _PAGE.format(
        title=escape(contents.title), style=STYLE, facts=facts, sections="\n".join(filter(None, sections))
    )


def png_bytes(picture: Bytes) -> bytes:
    """A picture as a PNG file's bytes."""
    _, data = cv2.imencode(".png", picture, [cv2.IMWRITE_PNG_COMPRESSION, 7])
    return bytes(np.asarray(data, np.uint8))


_PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; img-src data:; style-src 'unsafe-inline'">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>{style}</style>
</head>
<body>
<header>
<h1>{title}</h1>
<dl>{facts}</dl>
</header>
<main>
{sections}
</main>
</body>
</html>
"""


def _section(heading: str, body: str) -> str:
    return f"<section>\n<h2>{heading}</h2>\n{body}\n</section>" if body else ""


def _figures(figures: Sequence[Figure], layout: str) -> str:
    parts = []
    for figure in figures:
        data = base64.b64encode(png_bytes(figure.picture)).decode("ascii")
        tall, wide = figure.picture.shape[:2]
        words = escape(figure.caption)
        parts.append(
            f'<figure><img width="{wide}" height="{tall}" alt="{words}" src="data:image/png;base64,{data}">'
            f"<figcaption>{words}</figcaption></figure>"
        )
    return f'<div class="{layout}">{"".join(parts)}</div>' if parts else ""


def _chart(svg: str, caption: str) -> str:
    return f"<figure>{svg}<figcaption>{escape(caption)}</figcaption></figure>"


def _privacy(contents: Contents) -> str:
    if contents.has_images:
        return '<p class="note warn">This page shows images from the cameras. Share it with care.</p>'
    return '<p class="note">Drawn from the tracks alone: this page holds no image from a camera.</p>'


def _track_table(span: Span, tracks: Rows) -> str:
    rows = [
        (
            _swatch(int(row["id"])),
            _when(span, int(row["first"])),
            _when(span, int(row["last"])),
            f"{row['frames']}",
            f"{row['height']:.2f}",
            f"{row['score']:.1f}",
        )
        for row in tracks[:_MOST_ROWS]
    ]
    return _table(("track", "first", "last", "frames", "height, m", "score, nats"), rows, len(tracks))


def _event_summary(contents: Contents) -> str:
    """How often each kind of event occurred, and how many candidates were ghosts."""
    kinds, counts = np.unique(contents.events["kind"], return_counts=True)
    words = [f"{escape(kind.decode())} <b>{count}</b>" for kind, count in zip(kinds, counts.tolist(), strict=True)]
    if len(contents.candidates):
        ghosts = int((contents.candidates["status"] == 0).sum())
        words.append(f"ghosts removed <b>{ghosts}</b> of {len(contents.candidates)} candidates")
    return f'<p class="note">{" &middot; ".join(words) or "none"}</p>'


def _event_table(span: Span, events: Rows) -> str:
    if not len(events):
        return ""
    rows = [
        (
            _when(span, int(row["frame"])),
            escape(row["kind"].decode()),
            _swatch(int(row["id"])),
            _swatch(int(row["other"])) if row["other"] else "",
            escape(row["reason"].decode(errors="replace")),
        )
        for row in events[np.argsort(events["frame"], kind="stable")][:_MOST_ROWS]
    ]
    return _table(("frame", "event", "track", "other", "reason"), rows, len(events))


def _table(names: Sequence[str], rows: Iterable[Sequence[str]], total: int) -> str:
    head = "".join(f"<th>{escape(name)}</th>" for name in names)
    body = "\n".join(f"<tr>{''.join(f'<td>{cell}</td>' for cell in row)}</tr>" for row in rows)
    rest = f'<p class="note">The first {_MOST_ROWS} of {total} rows.</p>' if total > _MOST_ROWS else ""
    return f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>\n{body}\n</tbody></table></div>{rest}'


def _swatch(identity: int) -> str:
    return f'<i style="background:{hex_colour(track_colour(identity))}"></i>{identity}'


def _when(span: Span, frame: int) -> str:
    return f"{frame} <small>{clock_time(frame / span.frame_rate)}</small>"
