"""Signs of rigs and boxes that cannot be meant: wrong units, wrong columns, another image size, another frame rate.

Each sign takes many boxes. Where a reading of the numbers is named, it fits bodies on the ground, and the given one
does not. None of 23 views of five real recordings leaves one: by this, fewer than 13 in 100 views do (95 %).
"""

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Floats, Ints, Rows
from stseg.geometry import Camera, Grid, Rig

_LEAST_BOXES = 50
"""Least number of boxes, or of steps, for a statement."""
_MOST_BOXES = 4000
"""Most boxes, or steps, that are looked at."""
_FITTING, _MISFITTING = 0.5, 0.25
"""Least share of boxes that fit bodies under a reading that is named; largest share under the given one."""
_HARDLY = 0.02
"""Share of boxes that fit bodies below which the rig or the columns are doubted."""
_CORNERS = 0.99
"""Share of boxes larger than their distance from the image's corner, or within 2 pixels of it, for a statement."""
_HEIGHTS = (0.7, 1.3)
"""Heights of boxes that fit, in mean heights of a body."""
_GREATEST_PACE, _LEAST_PACE = 12.0, 0.01
"""Median speed, m/s, above which, and 90 % quantile, body heights a second, below which a frame rate is doubted."""
_STEP_TIME, _STEP_FRAMES = 0.1, 4
"""Time of a step, seconds, and most frames of it: in a shorter one a detector's errors are larger than steps."""
_RATES = (0.2, 250.0)
"""Usual frame rates, frames per second."""
_FARTHEST = 150.0
"""Greatest height of a camera above the ground, metres."""
_LOWEST_TOP, _HIGHEST_TOP = 0.6, 5.0
"""Heights of the uppermost plane that are no mistake, heights of a body."""
_LARGEST_CELL = 0.35
"""Side of a cell beyond which it is wider than a body, heights of that."""


def scene_warnings(rig: Rig, height: float) -> list[str]:
    """Warnings of a rig's numbers; `height` is the mean height of a body, metres."""
    warnings = []
    if len(rig.cameras) == 1:
        warnings.append("one camera alone: no other view confirms or denies what it shows")
    if not _LOWEST_TOP * height <= rig.grid.top <= _HIGHEST_TOP * height:
        warnings.append(f"grid.top is {rig.grid.top:g} m, and bodies are {height:g} m tall: is it in metres?")
    if rig.grid.cell > _LARGEST_CELL * height:
        warnings.append(f"grid.cell is {rig.grid.cell:g} m, wider than a body: is it in metres?")
    if not _RATES[0] <= rig.frame_rate <= _RATES[1]:
        warnings.append(f"frame_rate is {rig.frame_rate:g} frames per second: is it seconds per frame, or per minute?")
    high = [camera.name for camera in rig.cameras if abs(camera.centre[2]) > _FARTHEST]
    if high:
        warnings.append(f"camera {high[0]} is more than {_FARTHEST:g} m above the ground: is the rig in centimetres?")
    return warnings


def box_warnings(camera: Camera, grid: Grid, pixel: Floats, height: float) -> list[str]:
    """Warnings of a camera's boxes, float64 (n, 4) left, top, width, height, pixels."""
    pixel = pixel[:: max(1, len(pixel) // _MOST_BOXES)]
    if len(pixel) < _LEAST_BOXES:
        return []
    corner, size = pixel[:, :2], pixel[:, 2:]
    if np.quantile(corner + size, _CORNERS) <= 2:
        return [f"{camera.name}: all boxes lie within 0 to 2 pixels: are they shares of the image's width and height?"]
    if np.median(size.min(axis=1)) < 1:
        return [f"{camera.name}: half of its boxes are less than a pixel wide or high: are the columns right?"]
    if (size > corner).all(axis=1).mean() > _CORNERS:
        words = "are they corners x1, y1, x2, y2, given as left, top, width, height?"
        return [f"{camera.name}: nearly all boxes are larger than their distance from the image's corner: {words}"]
    given = _fitting_share(camera, grid, pixel, height)
    if given is None or given > _MISFITTING:
        return []
    readings = {"half": pixel * 2, "twice": pixel / 2}
    share, scale = max((_fitting_share(camera, grid, boxes, height) or 0.0, scale) for scale, boxes in readings.items())
    if share >= _FITTING:
        fit = f"{100 * given:.0f} % of its boxes fit a body on the ground"
        return [f"{camera.name}: {fit}, and {100 * share:.0f} % if they are pixels of an image {scale} as large"]
    if given < _HARDLY:
        return [f"{camera.name}: {100 * given:.0f} % of its boxes fit a body on the ground: are columns and rig right?"]
    return []


def _fitting_share(camera: Camera, grid: Grid, pixel: Floats, height: float) -> float | None:
    """Share of boxes that fit a body on the ground of the area; None where the camera looks down too steeply to say."""
    foot = np.stack([pixel[:, 0] + pixel[:, 2] / 2, pixel[:, 1] + pixel[:, 3]], -1)
    with np.errstate(invalid="ignore", divide="ignore"):
        ground = camera.back_project(foot)
        head, ahead = camera.project(ground, height)
        ratio = pixel[:, 3] / (foot[:, 1] - head[:, 1])
        distance = np.hypot(*(ground - camera.centre[:2]).T)
        fits = ahead & grid.contains(ground) & (ratio > _HEIGHTS[0]) & (ratio < _HEIGHTS[1])
        steep = grid.contains(ground) & (distance < abs(camera.centre[2]))
    if steep.sum() > len(pixel) / 4:
        return None
    return float(fits.mean())


def twin_warnings(names: Sequence[str], boxes: Sequence[Floats]) -> list[str]:
    """A warning of each camera whose boxes are those of another one."""
    return [
        f"cameras {names[one]} and {names[other]} have the same boxes: is it one file for both?"
        for other in range(len(names))
        for one in range(other)
        if len(boxes[one]) >= _LEAST_BOXES and np.array_equal(boxes[one], boxes[other])
    ]


def pace_warnings(frame_rate: float, frame: Ints, ground: Floats, height: float) -> list[str]:
    """A warning where people, float64 (n, 2) metres in frames (n,), would walk at no pace of people."""
    ground = ground[np.argsort(frame, kind="stable")]
    lag = min(max(round(_STEP_TIME * frame_rate), 1), _STEP_FRAMES)
    frames, number = np.unique(frame, return_counts=True)
    standing, steps = np.split(ground, np.cumsum(number)[:-1]), list[Floats]()
    begins = np.flatnonzero(np.isin(frames + lag, frames))
    for k in begins[:: max(1, len(frames) * 10 // _MOST_BOXES)].tolist():
        here, later = standing[k], standing[int(np.searchsorted(frames, frames[k] + lag))]
        steps.append(np.hypot(*(later[:, None] - here[None]).T).min(axis=1))
    speed = np.concatenate([*steps, np.zeros(0)]) * frame_rate / lag
    if len(speed) < _LEAST_BOXES:
        return []
    if (middle := float(np.median(speed))) > _GREATEST_PACE:
        return [f"people move at {middle:.0f} m/s in the median: are frame_rate and the units of the ground right?"]
    if (fast := float(np.quantile(speed, 0.9))) < _LEAST_PACE * height:
        return [f"9 of 10 people move at less than {100 * fast:.1g} cm/s: are frame_rate and the units right?"]
    return []


def track_warnings(frame_rate: float, trajectory: Rows) -> list[str]:
    """A warning where tracks of a run move at no pace of people."""
    rows = trajectory[np.lexsort((trajectory["frame"], trajectory["id"]))]
    follows = (np.diff(rows["id"]) == 0) & (np.diff(rows["frame"]) == 1)
    speed = np.hypot(np.diff(rows["x"]), np.diff(rows["y"]))[follows] * frame_rate
    if len(speed) >= _LEAST_BOXES and (middle := float(np.median(speed))) > _GREATEST_PACE:
        return [f"tracks move at {middle:.0f} m/s in the median: are frame_rate and the units of the ground right?"]
    return []
