"""The plan view: coverage, cameras and tracks from above."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import cv2
import numpy as np

from stseg.arrays import Bytes, Floats, Rows, by_track, ground_of
from stseg.geometry import Camera, Grid, Rig
from stseg.reporting.pictures.canvas import MAX_LABELS, chips, dashes, disc, fill, outline, stroke, text, text_size
from stseg.reporting.pictures.colours import INK, PAPER, QUIET, Colour, Picture, mixed, track_colour
from stseg.reporting.pictures.plan_map import LEGEND_WIDTH, PlanMap, rule, scale_bar, sheet

_CAMERA_DISTANCE = 0.45  # cameras within this share of the ground's longer side are shown where they stand
_CROWDED = 0.08  # length of all tracks from which they are drawn thin, pixels a pixel of the plan
_UNSEEN_TONE: Colour = (206, 199, 195)  # seen by no view
_TRUTH_COLOUR: Colour = (84, 76, 70)


def plan_view(
    rig: Rig,
    trajectory: Rows,
    truth: Rows | None = None,
    coverage: Bytes | None = None,
    title: str = "",
    width: int = 1400,
    height: int = 1500,
    names: Mapping[int, str] = MappingProxyType({}),
) -> Picture:
    """Draw the ground from above, y up.

    Parameters
    ----------
    trajectory : TRAJECTORY (n,)
        Coloured lines: a dot where a track starts, an arrow head and its id where it ends, dashes where it has gaps.
    truth : (m,) with frame, id, x, y
        Thin dark dashed lines; None for none.
    coverage : uint8 (y, x)
        Number of views that see each ground cell: the more, the lighter. None for plain paper.
    width, height
        The largest size of the picture, pixels.
    names
        Names of tracks by id, which then stand instead of their ids.
    """
    plan = plan_map(rig, width, height)
    canvas, obstacles = ground_sheet(plan, rig, coverage, title or rig.name)
    _draw_tracks(canvas, plan, trajectory)
    if truth is not None:
        for _, path in _paths(truth):
            dashes(canvas, plan.pixel(path), _TRUTH_COLOUR)
    _label_tracks(canvas, plan, trajectory, names, obstacles)
    _legend(canvas, plan, None if coverage is None else int(coverage.max()), truth is not None)
    return canvas


def ground_sheet(plan: PlanMap, rig: Rig, coverage: Bytes | None, title: str) -> tuple[Bytes, Floats]:
    """The ground without tracks: coverage (see `plan_view`), and what `draw_ground` draws and returns."""
    canvas = sheet(plan, title)
    if coverage is not None:
        _shade(canvas, plan, rig.grid, coverage)
    return canvas, draw_ground(canvas, plan, rig)


def draw_ground(canvas: Bytes, plan: PlanMap, rig: Rig) -> Floats:
    """Grid lines, the border of the area of interest, and cameras; returns pixels of their names, float64 (n, 2)."""
    rule(canvas, plan)
    outline(canvas, plan.pixel(rig.grid.corners), mixed(INK, PAPER, 0.35), 2)
    return _draw_cameras(canvas, plan, rig.cameras)


def plan_map(rig: Rig, width: int = 1400, height: int = 1500, least_width: int = LEGEND_WIDTH) -> PlanMap:
    """The map from metres to pixels of `plan_view`."""
    low, high = np.array([rig.grid.x, rig.grid.y]).T
    places = np.array([camera.centre[:2] for camera in rig.cameras]).reshape(-1, 2)
    is_near = np.maximum(low - places, places - high).max(axis=1) <= _CAMERA_DISTANCE * (high - low).max()
    return PlanMap.fit(rig.grid, places[is_near], width, height, least_width)


def _shade(canvas: Bytes, plan: PlanMap, grid: Grid, coverage: Bytes) -> None:
    """Paint the cells; what is outside the rectangle, or the polygon, stays paper."""
    most = max(int(coverage.max()), 1)
    tones = np.array([_tone(count, most) for count in range(most + 1)], np.uint8)
    picture = np.where(grid.inside()[..., None], tones[coverage], np.array(PAPER, np.uint8))[::-1]
    low = np.rint(plan.pixel(np.array([grid.x[0], grid.y[1]]))).astype(int)
    high = np.rint(plan.pixel(np.array([grid.x[1], grid.y[0]]))).astype(int)
    size = (int(high[0] - low[0]), int(high[1] - low[1]))
    canvas[low[1] : high[1], low[0] : high[0]] = cv2.resize(picture, size, interpolation=cv2.INTER_NEAREST)


def _tone(count: int, most: int) -> Colour:
    return mixed(_UNSEEN_TONE, (252, 251, 250), count / most)


def _draw_cameras(canvas: Bytes, plan: PlanMap, cameras: Sequence[Camera]) -> Floats:
    """Every camera, and its name behind it, below the names that are there already; returns pixels of names (n, 2)."""
    named: list[tuple[float, float, int]] = []
    for camera in cameras:
        tone, name, (u, v) = _draw_camera(canvas, plan, camera)
        width = text_size(name, 15)[0]
        while any(abs(u - other) < (width + wide) / 2 and abs(v - below) < 20 for other, below, wide in named):
            v += 20
        named.append((u, v, width))
        text(canvas, name, (u, v), tone, 15, (0.5, 0.5))
    along = [np.linspace(u - wide / 2, u + wide / 2, 12) for u, _, wide in named]
    return np.stack([np.ravel(along), np.repeat([v for _, v, _ in named], 12)], -1)


def _draw_camera(canvas: Bytes, plan: PlanMap, camera: Camera) -> tuple[Colour, str, tuple[float, float]]:
    """A sector as wide as the view, pointing where it looks; at the edge of the plan, hollow, where it stands beyond.

    Returns its colour, its name, with how far beyond the plan it stands, and where the middle of that may be.
    """
    position = camera.centre[:2]
    edge = np.clip(position, [plan.x[0], plan.y[0]], [plan.x[1], plan.y[1]])
    place, distance = plan.pixel(edge), float(np.hypot(*(position - edge)))
    tone, name = (QUIET, f"{camera.name}, {distance:.1f} m beyond") if distance else (INK, camera.name)
    directions = _view_directions(camera)
    if directions is not None:
        sector = np.concatenate([place[None], place + 46 * directions])
        fill(canvas, sector, tone, 0.16)
        outline(canvas, sector, mixed(tone, PAPER, 0.35))
    disc(canvas, place, 6, tone if distance else PAPER)
    disc(canvas, place, 4.5, PAPER if distance else tone)
    back = np.array([0.0, -1.0]) if directions is None else -directions[len(directions) // 2]
    return tone, name, _name_place(name, place, back, plan)


def _name_place(name: str, place: Floats, back: Floats, plan: PlanMap) -> tuple[float, float]:
    """Middle of a camera's name: behind it; beside or before it at the canvas' end and at the numbers of the axes."""
    (wide, tall), space = text_size(name, 15), np.array(plan.size)
    half, across = np.array([wide / 2, tall / 2]), np.array([-back[1], back[0]])
    wished = [place + way * (14 + wide / 2, 22) for way in (back, across, -across, -back)]
    inside = [np.clip(middle, (wide / 2 + 4, tall), space - (wide / 2 + 4, tall)) for middle in wished]
    moved = [round(np.abs(one - other).max()) for one, other in zip(inside, wished, strict=True)]
    middles = [inside[k] for k in np.argsort(moved, kind="stable")]
    free = (middle for middle in middles if not plan.covers_numbers(middle - half, middle + half))
    u, v = next(free, middles[0]).tolist()
    return u, v


def _view_directions(camera: Camera) -> Floats | None:
    """Directions on the canvas (v down) from the left of the view to its right; None where it looks down.

    float64 (k, 2), unit length; the one in the middle is that of the middle of the view's angle.
    """
    width, height = camera.size
    ray = camera.rays(np.array([[0.0, height / 2], [width / 2, height / 2], [width - 1.0, height / 2]]))
    length = np.hypot(ray[:, 0], ray[:, 1])
    if not np.isfinite(ray).all() or (length < 0.2 * np.linalg.norm(ray, axis=1)).any():
        return None
    angle = np.unwrap(np.arctan2(-ray[:, 1], ray[:, 0]))
    between = np.linspace(angle[0], angle[2], 13)
    return np.stack([np.cos(between), np.sin(between)], -1)


def _paths(table: Rows) -> list[tuple[int, Floats]]:
    """Each id with its places in order of time; a nan stands where frames are missing."""
    paths = []
    numbers = np.unique(table["frame"])
    # Frames from one row to the next where nothing is missing: truth may be sparse.
    step = int(np.diff(numbers).min()) if len(numbers) > 1 else 1
    for rows in by_track(table):
        places = ground_of(rows)
        gaps = np.flatnonzero(np.diff(rows["frame"]) > step) + 1
        paths.append((int(rows["id"][0]), np.insert(places, gaps, np.nan, axis=0)))
    return paths


def _draw_tracks(canvas: Bytes, plan: PlanMap, trajectory: Rows) -> None:
    paths = _paths(trajectory)
    few, some = len(paths) <= 12, len(paths) <= 60
    length = sum(float(np.nansum(np.hypot(*np.diff(plan.pixel(path), axis=0).T))) for _, path in paths)
    crowded = length > _CROWDED * np.prod(np.subtract(plan.far_corner, plan.corner))
    width = 1 if crowded or not some else 3 if few else 2
    opacity = 1.0 if some else max(0.2, 0.7 * (60 / len(paths)) ** 0.5)
    for identity, path in paths:
        colour, pixel = track_colour(identity), plan.pixel(path)
        drawn = pixel[np.isfinite(pixel[:, 0])]
        if len(drawn) < len(pixel):
            dashes(canvas, drawn, mixed(colour, PAPER, 0.4), 1, 3, 5)
        stroke(canvas, pixel, colour, width, opacity)
    size = 1.0 if few else 0.8 if some else 0.5
    for identity, path in paths:
        _draw_ends(canvas, plan.pixel(path[np.isfinite(path[:, 0])]), track_colour(identity), size)


def _draw_ends(canvas: Bytes, pixel: Floats, colour: Colour, size: float) -> None:
    """A dot at the start; at the end a head that points where the track was going."""
    disc(canvas, pixel[0], 7.5 * size, PAPER)
    disc(canvas, pixel[0], 6 * size, colour)
    end = pixel[-1]
    far = np.flatnonzero(np.hypot(*(pixel - end).T) > 12)
    ahead = end - pixel[far[-1]] if len(far) else np.array([0.0, -1.0])
    ahead = ahead / np.hypot(*ahead)
    side = np.array([-ahead[1], ahead[0]])
    head = end + size * np.array([13 * ahead, -6 * ahead + 8 * side, -2 * ahead, -6 * ahead - 8 * side])
    outline(canvas, head, PAPER, 3)
    fill(canvas, head, colour)


def _label_tracks(canvas: Bytes, plan: PlanMap, trajectory: Rows, names: Mapping[int, str], obstacles: Floats) -> None:
    """Ids beside the ends, clear of obstacles; of many tracks only the longest."""
    paths = sorted(_paths(trajectory), key=lambda path: -len(path[1]))[:MAX_LABELS]
    size = 14.0 if len(paths) <= 12 else 11.0
    ends = np.array([plan.pixel(path[-1]) for _, path in paths]).reshape(-1, 2)
    labels = [names.get(identity, str(identity)) for identity, _ in paths]
    colours = [track_colour(identity) for identity, _ in paths]
    chips(canvas, np.concatenate([ends, obstacles]), labels, colours, size, (*plan.corner, *plan.far_corner), 16)


def _legend(canvas: Bytes, plan: PlanMap, most: int | None, has_truth: bool) -> None:
    """Below the plan: what the tones and marks mean, and a scale bar."""
    u, v = 76.0, plan.size[1] - 38.0
    if most is not None:
        text(canvas, "views", (u, v), QUIET, 15, (0, 0.5))
        place = u + text_size("views", 15)[0] + 10, v
        u = legend_of_tones(canvas, place, [_tone(count, max(most, 1)) for count in range(most + 1)]) + 28
    colour = track_colour(1)
    line = np.array([[u, v], [u + 46, v]])
    stroke(canvas, line, colour, 3)
    _draw_ends(canvas, line, colour, 0.8)
    text(canvas, "track", (u + 66, v), QUIET, 15, (0, 0.5))
    u += 66 + text_size("track", 15)[0] + 28
    if has_truth:
        dashes(canvas, np.array([[u, v], [u + 46, v]]), _TRUTH_COLOUR)
        text(canvas, "truth", (u + 56, v), QUIET, 15, (0, 0.5))
    scale_bar(canvas, plan, (plan.size[0] - 44.0, v))


def legend_of_tones(canvas: Bytes, place: tuple[float, float], tones: Sequence[Colour]) -> float:
    """A square for each number of views from `place` on; returns where they end."""
    u, v = place
    wide = min(30.0, 300.0 / len(tones))
    for count, tone in enumerate(tones):
        square = np.array([[u, v - 14], [u + wide, v - 14], [u + wide, v + 14], [u, v + 14]])
        fill(canvas, square, tone)
        outline(canvas, square, mixed(QUIET, PAPER, 0.5))
        if wide > 20 or count in (0, len(tones) - 1):
            text(canvas, str(count), (u + wide / 2, v), PAPER if sum(tone) < 320 else INK, 14, (0.5, 0.5))
        u += wide
    return u
