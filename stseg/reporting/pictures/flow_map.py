"""Map of density with arrows of flow, zones and lines."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Bytes, Floats, Rows
from stseg.geometry import Rig
from stseg.reporting.pictures.canvas import chip, chip_size, fill, outline, stroke
from stseg.reporting.pictures.colours import INK, PAPER, Colour, mixed
from stseg.reporting.pictures.labels import place_labels
from stseg.reporting.pictures.maps import Bins, heat_map, map_of_maps
from stseg.reporting.pictures.plan_map import PlanMap

_ZONE: Colour = (150, 110, 40)
_LINE: Colour = (60, 60, 200)


def flow_map(
    rig: Rig, field: Rows, zones: Sequence[tuple[str, Sequence[Floats]]], lines: Sequence[tuple[str, Floats]]
) -> Bytes:
    """Density from above, with an arrow of the mean velocity in each busy bin.

    Parameters
    ----------
    rig
    field : CELL (bins,)
        Of `stseg.measures.motion.flow_field`.
    zones
        Name and rings of each, metres.
    lines
        Name and points of each, metres.

    Returns
    -------
    uint8 (v, u, 3)
        Blue, green, red.
    """
    x = np.unique(field["x"])
    side = float(np.diff(x).min()) if len(x) > 1 else rig.grid.x[1] - rig.grid.x[0]
    bins = Bins(rig.grid.x, rig.grid.y, side)
    values = field["density"].reshape(bins.shape)
    canvas = heat_map(rig, bins, values, "Density and flow", "people a square metre")
    plan = map_of_maps(rig)
    for _, rings in zones:
        for ring in rings:
            outline(canvas, plan.pixel(ring), _ZONE, 2)
    for _, points in lines:
        stroke(canvas, plan.pixel(points), _LINE, 3)
    busy = field["density"] > 0.1 * max(float(field["density"].max(initial=0.0)), 1e-9)
    for row in field[busy]:
        _arrow(canvas, plan, row, side)
    _name(canvas, plan, [*((name, rings[0], _ZONE) for name, rings in zones), *((*line, _LINE) for line in lines)])
    return canvas


def _name(canvas: Bytes, plan: PlanMap, named: Sequence[tuple[str, Floats, Colour]]) -> None:
    """Names beside the middles of zones and lines."""
    places = np.array([plan.pixel(points.mean(axis=0)) for _, points, _ in named]).reshape(-1, 2)
    sizes = [chip_size(name, 11) for name, *_ in named]
    centres = place_labels(places, sizes, (*plan.corner, *plan.far_corner), 8)
    for (name, _, colour), (u, v) in zip(named, centres.tolist(), strict=True):
        chip(canvas, name, (u, v), colour, 11)


def _arrow(canvas: Bytes, plan: PlanMap, row: np.void, side: float) -> None:
    """An arrow of up to a bin's side: the mean velocity, 1.5 m/s or more at full length."""
    velocity = np.array([row["flow_x"], row["flow_y"]]) / max(float(row["density"]), 1e-9)
    speed = float(np.hypot(*velocity))
    if speed < 0.1:
        return
    centre, ahead = np.array([row["x"], row["y"]]), velocity / speed
    half = 0.5 * side * min(speed / 1.5, 1.0) * ahead
    tip, tail = plan.pixel(centre + half), plan.pixel(centre - half)
    way = (tip - tail) / max(float(np.hypot(*(tip - tail))), 1e-9)
    across = np.array([-way[1], way[0]])
    stroke(canvas, np.stack([tail, tip]), mixed(INK, PAPER, 0.1), 2)
    fill(canvas, np.stack([tip + 5 * way, tip - 4 * way + 4 * across, tip - 4 * way - 4 * across]), INK)
