"""The page on which ground points are clicked: frames of all cameras, a plan, style and script in one file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

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
    names: Sequence[str], frames: Sequence[Bytes], area: tuple[float, float, float, float], plan: FloorPlan | None
) -> str:
    """The page's text.

    Parameters
    ----------
    names, frames
        Name and a frame of each camera, uint8 (v, u, 3).
    area
        x0, y0, x1, y1 of the plan, metres; a floor plan's picture spans it.
    plan
        Drawn below the plan's grid; None for a grid alone.
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
            {"name": name, "width": frame.shape[1], "height": frame.shape[0], "image": _jpeg(frame)}
            for name, frame in zip(names, frames, strict=True)
        ],
    }
    title = "Ground points"
    return page(title, _BODY.format(title=title), script_json(data), ("calibration_page.js",), _STYLE)


def _jpeg(image: Bytes) -> str:
    share = min(1.0, _MAX_FRAME_WIDTH / image.shape[1])
    scaled = image if share == 1 else cv2.resize(image, None, fx=share, fy=share, interpolation=cv2.INTER_AREA)
    return jpeg_uri(np.asarray(scaled, np.uint8), 90)


_STYLE = """
#sheets { display: grid; grid-template-columns: repeat(auto-fit, minmax(460px, 1fr)); gap: 16px }
#sheets figure { margin: 0 } #sheets canvas { width: 100%; cursor: crosshair; border: 1px solid var(--rule) }
#lens { position: fixed; border: 2px solid #fff; border-radius: 50%; pointer-events: none; z-index: 9 }
#csv { width: 100%; height: 140px; font-family: monospace } main { max-width: none }
.tools > * { margin-right: 12px }
"""

_BODY = """<main>
<h1>{title}</h1>
<p>Click a place of the ground in two or more views and on the plan; then <b>N</b> for the next point. The homographies
are solved as you click and drawn as a grid; a ring shows where the next point helps most. <b>P</b> begins the top of a
pole above the point, <b>arrows</b> move by a quarter pixel (with shift, one), <b>[ ]</b> choose a point,
<b>Delete</b> removes it, <b>Ctrl+Z</b> undoes, the wheel zooms. This page shows frames of the cameras and loads
nothing.</p>
<p class="tools">point <b id="which"></b> <button id="new">New point (N)</button>
<button id="raise">Pole (P), m</button><input id="pole" type="number" value="2" step="0.01" size="5" aria-label="pole">
<button id="undo">Undo</button> <a id="save" download="points.csv">Save points.csv</a></p>
<div id="sheets"></div>
<table><thead><tr><th>point</th><th>camera</th><th>off px</th><th>off cm</th></tr></thead>
<tbody id="residuals"></tbody></table>
<textarea id="csv" readonly aria-label="points.csv"></textarea>
<p>Then: <code>stseg calibrate points points.csv -o rig.toml --size W,H --area=... --frame-rate ...</code></p>
</main>
<canvas id="lens" width="160" height="160" hidden></canvas>"""
