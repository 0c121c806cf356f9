"""The template of every page, and its pieces: sections, figures, tables, and how tracks and times are written.

A page holds its style, and a script with its data; nothing is loaded from elsewhere.
"""

import base64
import hashlib
import json
from collections.abc import Iterable, Sequence
from html import escape
from importlib.resources import files

import cv2
import numpy as np

from stseg.arrays import Bytes
from stseg.reporting.charts import clock_time
from stseg.reporting.figures import Figure
from stseg.reporting.pictures.colours import hex_colour, track_colour
from stseg.reporting.run_statistics import Span

STYLE = """
:root { --ink: #2a2e34; --quiet: #7c828a; --rule: #e4e6ea; --soft: #f6f7f9; --accent: #0b70d8 }
* { box-sizing: border-box }
body { margin: 0; font: 15px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", sans-serif;
  color: var(--ink); background: var(--soft) }
header, main { max-width: 1240px; margin: 0 auto; padding: 0 24px }
header { padding-top: 40px }
h1 { font-size: 30px; letter-spacing: -0.02em; margin: 0 0 20px }
h2 { font-size: 19px; letter-spacing: -0.01em; margin: 0 0 16px }
header dl { display: flex; flex-wrap: wrap; gap: 10px; margin: 0 }
header dl div { background: #fff; padding: 10px 18px; border: 1px solid var(--rule); border-radius: 12px }
dt { color: var(--quiet); font-size: 13px }
dd { margin: 0 }
header dd { font-size: 18px; white-space: nowrap; font-weight: 600; font-variant-numeric: tabular-nums }
section { background: #fff; border: 1px solid var(--rule); border-radius: 12px; padding: 24px; margin: 24px 0 }
figure { margin: 0; min-width: 0 }
figcaption { color: var(--quiet); font-size: 13px; margin-top: 6px }
img { max-width: 100%; height: auto; display: block; border-radius: 6px }
h3 { font-size: 15px; margin: 14px 0 2px }
h3 + p { margin: 0; max-width: 90ch }
canvas { width: 100%; display: block; border-radius: 6px }
#thread { cursor: grab; touch-action: none }
.live { display: none }
body.scripted .live { display: block }
body.scripted .pair.live { display: grid }
#time { display: none; position: sticky; bottom: 0; flex-wrap: wrap; gap: 6px 14px; align-items: center;
  padding: 10px 24px;
  background: #fffffff2; border-top: 1px solid var(--rule); box-shadow: 0 -4px 16px #0000000d }
body.scripted #time { display: flex }
#slider { flex: 1 1 160px; accent-color: var(--accent) }
#clock { min-width: min(26em, 100%); font-variant-numeric: tabular-nums }
button, select { font: inherit; color: inherit; background: #fff; border: 1px solid var(--rule); border-radius: 8px;
  padding: 3px 10px }
select { font-size: 13px }
tr.ghost { color: var(--quiet) }
tr.ghost:hover { background: #fff3ec }
td.no { color: #b0300f }
td.yes { color: #1d7a46 }
td.unsure { color: var(--quiet) }
.bars { display: grid; grid-template-columns: minmax(120px, 240px) 1fr; gap: 6px 14px; align-items: center }
.bars dt { color: inherit; font-size: 14px }
.bars dd { font-size: 14px; font-weight: 400 }
.bars i { display: inline-block; height: 12px; min-width: 1px; background: var(--accent); opacity: 0.55;
  border-radius: 3px; vertical-align: -1px; margin-right: 6px }
.bars small { color: var(--quiet) }
.pair { display: grid; grid-template-columns: repeat(auto-fit, minmax(440px, 1fr)); gap: 20px; align-items: start }
.pair > figure:last-child:nth-child(odd) { grid-column: 1 / -1; justify-self: center }
.sheets { display: grid; grid-template-columns: 2fr 1fr; gap: 32px 20px; align-items: start }
@media (max-width: 900px) { .sheets, .pair { grid-template-columns: minmax(0, 1fr) } }
.chart { width: 100%; height: auto; display: block; margin-top: 8px }
.chart text { font-size: 12px; fill: var(--quiet); font-variant-numeric: tabular-nums }
.chart .on { fill: #fff; font-size: 10px; font-weight: 600 }
.chart .pale { fill: #fff; opacity: 0.55 }
.chart .rule { stroke: var(--rule) }
.chart .area { fill: var(--accent); opacity: 0.12 }
.chart .line { fill: none; stroke: var(--accent); stroke-width: 1.8 }
.chart .truth { fill: none; stroke: #464c54; stroke-width: 1.2; stroke-dasharray: 5 4 }
.note { color: var(--quiet); margin: 0 0 12px }
.note b { color: var(--ink) }
.scroll + .note, .bars + .note { margin-top: 12px }
.warn { color: #a34a00 }
.scroll { max-height: 420px; overflow: auto; margin-top: 16px; border: 1px solid var(--rule); border-radius: 8px }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums }
th, td { text-align: left; padding: 6px 14px; border-bottom: 1px solid var(--rule); white-space: nowrap }
th { position: sticky; top: 0; background: var(--soft); color: var(--quiet); font-weight: 500; font-size: 13px }
td i { display: inline-block; width: 12px; height: 12px; border-radius: 4px; margin-right: 8px; vertical-align: -1px }
td small { color: var(--quiet); margin-left: 6px }
td:last-child { white-space: normal; min-width: 14em }
@media print { #time { display: none !important } section { break-inside: avoid } .scroll { max-height: none } }
"""

_PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="generator" content="made by stseg">
<meta http-equiv="Content-Security-Policy"
 content="default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'sha256-{digest}'">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>{style}</style>
</head>
<body>
{body}
<script id="data" type="application/json">{data}</script>
<script>{script}</script>
</body>
</html>
"""


def page(title: str, body: str, data: str, scripts: Sequence[str], style: str = "") -> str:
    """The text of a page.

    Parameters
    ----------
    body
        HTML before the script.
    data
        JSON for the script, see `script_json`.
    scripts
        Names of the files in this folder that make the script.
    style
        Rules of the page beside `STYLE`.
    """
    script = "\n".join((files("stseg.reporting.page") / name).read_text("utf-8") for name in scripts)
    digest = base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")
    return _PAGE.format(title=escape(title), style=STYLE + style, digest=digest, body=body, data=data, script=script)


def script_json(data: object) -> str:
    """Data as JSON, safe inside a script element."""
    return json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


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
    source = jpeg_uri(picture.picture, 85) if len(data) > _MAX_PNG else data_uri("image/png", data)
    tall, wide = picture.picture.shape[:2]
    words = escape(picture.caption)
    return (
        f'<figure><img width="{wide}" height="{tall}" alt="{words}" src="{source}">'
        f"<figcaption>{words}</figcaption></figure>"
    )


def jpeg_uri(picture: Bytes, quality: int) -> str:
    """A picture as the address of a JPEG inside the page; `quality` is 1..100."""
    _, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return data_uri("image/jpeg", bytes(np.asarray(data, np.uint8)))


def data_uri(kind: str, data: bytes) -> str:
    """Data of a kind such as image/png as an address inside a page."""
    return f"data:{kind};base64,{base64.b64encode(data).decode('ascii')}"


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
