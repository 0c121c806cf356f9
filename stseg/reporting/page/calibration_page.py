"""The page on which ground points are clicked: frames of all cameras, a plan, style and script in one file."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import cv2
import numpy as np

from stseg.arrays import Bytes
from stseg.reporting.page.html import jpeg_uri, page, script_json

_MAX_FRAME_WIDTH = 1920
"""Greatest width of a frame in the page, pixels; points are in the camera's own pixels."""
_PLAN_SIZE = 900
"""Size of a plan without a picture, pixels."""


@dataclass(frozen=True)
class FloorPlan:
    """A picture of the ground from above, y up."""

    image: Bytes
    """uint8 (v, u, 3)."""
    scale: float
    """Pixels a metre."""


def calibration_page(
    names: Sequence[str],
    frames: Sequence[Sequence[Bytes]],
    area: tuple[float, float, float, float],
    plan: FloorPlan | None,
    command: str,
) -> str:
    """The page's text.

    Parameters
    ----------
    names, frames
        Name and one or more frames of each camera, uint8 (v, u, 3); a slider chooses among them.
    area
        x0, y0, x1, y1 of the plan, metres; a floor plan's picture spans it.
    plan
        Drawn below the plan's grid; None for a grid alone.
    command
        The next one, for whoever has saved points.csv.
    """
    x0, y0, x1, y1 = area
    scale = plan.scale if plan is not None else _PLAN_SIZE / max(x1 - x0, y1 - y0)
    data = {
        "area": area,
        "plan": {
            "scale": scale,
            "width": (x1 - x0) * scale,
            "height": (y1 - y0) * scale,
            "image": None if plan is None else _jpeg(plan.image),
        },
        "cameras": [
            {
                "name": name,
                "width": one[0].shape[1],
                "height": one[0].shape[0],
                "images": [_jpeg(frame) for frame in one],
            }
            for name, one in zip(names, frames, strict=True)
        ],
    }
    title = "Ground points"
    return page(
        title,
        _BODY.format(moments=max(map(len, frames)) - 1, command=escape(command)),
        script_json(data),
        ("calibration_page.js",),
        _STYLE,
    )


def _jpeg(image: Bytes) -> str:
    share = min(1.0, _MAX_FRAME_WIDTH / image.shape[1])
    scaled = image if share == 1 else cv2.resize(image, None, fx=share, fy=share, interpolation=cv2.INTER_AREA)
    return jpeg_uri(np.asarray(scaled, np.uint8), 90)


_STYLE = """
main { max-width: none; padding: 0 12px } h1 { font-size: 18px; margin: 6px 0 } summary { cursor: pointer }
#sheets { display: grid; gap: 8px } #sheets canvas { cursor: crosshair; border: 1px solid var(--rule) }
#sheets figcaption { margin: 0; white-space: nowrap; overflow: hidden; text-overflow: ellipsis }
#lens { position: fixed; width: 160px; height: 160px; border: 2px solid #fff; border-radius: 50%; pointer-events: none }
#csv { width: 100%; height: 140px; font-family: monospace }
.tools { margin: 4px 0 } .tools > * { margin-right: 8px } .tools input[type=number] { width: 5em }
.tools input[type=range] { width: 80px } .tools a { white-space: nowrap }
"""

_BODY = """<main>
<details><summary>Click a place of the ground in two or more views and on the plan, or enter its x and y; then <b>N</b>
for the next point.</summary>
<p>The homographies are solved as you click and drawn as a grid; a ring shows where the next point helps most. A
crossing of that grid that is dragged with <b>shift</b> becomes a point. <b>P</b> begins the top of a pole above the
point, <b>arrows</b> move by a quarter pixel (with shift, one), <b>[ ]</b> choose a point, <b>Delete</b> removes it,
<b>Ctrl+Z</b> undoes, the wheel zooms. This page shows frames of the cameras and loads nothing.</p></details>
<p class="tools">point <b id="which"></b> x <input id="x" type="number" step="any" aria-label="x, metres">
y <input id="y" type="number" step="any" aria-label="y, metres"> z <input id="z" type="number" step="any" min="0"
aria-label="z, metres"> m <button id="new">Next (N)</button> <button id="raise">Pole (P), m</button><input
id="pole" type="number" value="2" step="any" aria-label="pole"> <button id="undo">Undo</button>
<label>snap <select id="snap"><option value="0">off</option><option>0.05</option><option>0.1</option>
<option>0.5</option><option>1</option></select> m</label>
<label>frame <input id="moment" type="range" min="0" max="{moments}" value="0"></label>
<a id="save" download="points.csv">Save points.csv</a></p>
<div id="sheets"></div>
<p>Then: <code>{command}</code></p>
<table><thead><tr><th>point</th><th>camera</th><th>off px</th><th>off cm</th></tr></thead>
<tbody id="residuals"></tbody></table>
<textarea id="csv" readonly aria-label="points.csv"></textarea>
</main>
<canvas id="lens" width="160" height="160" hidden></canvas>"""
