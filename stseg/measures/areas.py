"""Zones and lines on the ground: people in zones, their visits, and crossings of lines by direction."""

from dataclasses import dataclass

import numpy as np
import shapely
from scipy.special import expit, ndtr
from shapely.geometry.base import BaseGeometry

from stseg.arrays import Flags, Floats, Ints, Rows, by_track, columns, ground_of
from stseg.geometry import Grid
from stseg.geometry.grid import inside_polygon


@dataclass(frozen=True)
class Zone:
    """A named area: polygons on the ground, metres, each float64 (k, 2); holes are polygons within polygons."""

    name: str
    rings: tuple[Floats, ...]

    def contains(self, ground: Floats) -> Flags:
        """Whether each ground point (n, 2) is inside, bool (n,): even-odd rule over all rings."""
        inside = np.zeros(len(ground), bool)
        for ring in self.rings:
            inside ^= inside_polygon(ground, ring)
        return inside

    def probability(self, trajectory: Rows) -> Floats:
        """Probability that each row is inside, float64 (n,), by its covariance and the nearest edge."""
        ground = ground_of(trajectory)
        edges = [Line("", np.append(ring, ring[:1], axis=0)).distance(ground) for ring in self.rings]
        away = np.min(edges, axis=0) / np.sqrt(np.maximum(trajectory["xx"] + trajectory["yy"], 1e-12) / 2)
        return np.asarray(ndtr(np.where(self.contains(ground), away, -away)))

    @property
    def fault(self) -> str | None:
        """Why a ring is no border, as where it intersects itself, in the words of shapely; None where all are."""
        reasons = [shapely.is_valid_reason(shapely.Polygon(ring)) for ring in self.rings]
        return next((reason for reason in reasons if reason != "Valid Geometry"), None)

    def area_on(self, grid: Grid) -> float:
        """Area that counts on a ground, square metres: nobody is tracked beside it."""
        (x0, x1), (y0, y1) = grid.x, grid.y
        ground = shapely.intersection(shapely.box(x0, y0, x1, y1), shapely.make_valid(shapely.Polygon(grid.corners)))
        zone: BaseGeometry = shapely.Polygon()
        for ring in self.rings:
            zone = zone.symmetric_difference(shapely.make_valid(shapely.Polygon(ring)))
        return float(shapely.intersection(zone, ground).area)


@dataclass(frozen=True)
class Line:
    """A named line on the ground, float64 (k, 2), metres. `left` and `right` are as seen along it."""

    name: str
    points: Floats

    def distance(self, ground: Floats) -> Floats:
        """Distance of each ground point (n, 2) from the line, metres, float64 (n,)."""
        nearest = np.full(len(ground), np.inf)
        for start, way in zip(self.points, np.diff(self.points, axis=0), strict=False):
            along = np.clip((ground - start) @ way / max(way @ way, 1e-12), 0, 1)
            nearest = np.minimum(nearest, np.hypot(*(ground - start - along[:, None] * way).T))
        return nearest


@dataclass(frozen=True)
class Areas:
    """Zones and lines to measure in."""

    zones: tuple[Zone, ...] = ()
    lines: tuple[Line, ...] = ()


COUNT = columns("frame:<i8 time:<f8 zone:O people:<i8 expected:<f8 deviation:<f8 density:<f8")
"""One row per zone and frame: number of tracks; its mean and standard deviation by the tracks' scores and the errors of
their places, and by people missed or made up; people a square metre."""
VISIT = columns("zone:O id:<i8 first:<i8 last:<i8 start:<f8 dwell:<f8 entered:? left:?")
"""One row per stay of a track in a zone: frames, seconds; whether the track was seen outside before and after."""
SYSTEMATIC_SHARE = 0.05
"""Standard deviation of a count by systematic errors, people missed or made up and shifted cameras: share of it."""
AWAY = 5.0
"""Gap of a track from which its person was away, seconds."""


def zone_counts(zone: Zone, area: float, trajectory: Rows, frames: Ints, frame_rate: float) -> Rows:
    """People in a zone, of an area in square metres, in every frame of a run, COUNT (time,).

    A track exists with probability 1 / (1 + exp(-score)) of its row, and is inside with that of its place,
    independently of the others; the count's mean is the sum of their products p, its variance that of p (1 - p) and of
    the square of SYSTEMATIC_SHARE of the mean.
    """
    index = np.searchsorted(frames, trajectory["frame"])
    inside = zone.contains(ground_of(trajectory))
    present = expit(trajectory["score"].astype(float)) * zone.probability(trajectory)
    rows = np.zeros(len(frames), COUNT)
    rows["frame"], rows["time"], rows["zone"] = frames, frames / frame_rate, zone.name
    rows["people"] = np.bincount(index[inside], minlength=len(frames))
    rows["expected"] = np.bincount(index, present, len(frames))
    brief = np.bincount(index, present * (1 - present), len(frames))
    rows["deviation"] = np.sqrt(brief + (SYSTEMATIC_SHARE * rows["expected"]) ** 2)
    rows["density"] = rows["people"] / (area or np.nan)
    return rows


def standard_error(counts: Rows, frame_rate: float) -> float:
    """Standard error of the mean of a zone's COUNT rows, people: all err alike systematically, else for a second."""
    systematic, frames = SYSTEMATIC_SHARE * counts["expected"], max(len(counts), 1)
    brief = (counts["deviation"] ** 2 - systematic**2).sum() * min(max(frame_rate, 1.0), frames)
    return float(np.hypot(np.sqrt(max(brief, 0.0)), systematic.sum())) / frames


def zone_visits(zone: Zone, trajectory: Rows, frame_rate: float, patience: float) -> Rows:
    """Stays of tracks in a zone, VISIT (n,), by start; absences of up to `patience` seconds do not end a stay."""
    visits = []
    for track in by_track(trajectory):
        inside = zone.contains(ground_of(track))
        starts, stops = _spells(inside, track["frame"], round(patience * frame_rate))
        for start, stop in zip(starts.tolist(), stops.tolist(), strict=True):
            first, last = int(track["frame"][start]), int(track["frame"][stop - 1])
            dwell = (last - first + 1) / frame_rate
            visits.append(
                (zone.name, int(track["id"][0]), first, last, first / frame_rate, dwell, start > 0, stop < len(track))
            )
    return np.sort(np.array(visits, VISIT), order=["first", "id"])


def stays(track: Rows, frame_rate: float) -> list[Rows]:
    """The rows of one track, parted where its person was away: the way from the exit to the entrance is unknown."""
    return np.split(track, np.flatnonzero(np.diff(track["frame"]) > AWAY * frame_rate) + 1)


def _spells(inside: Flags, frame: Ints, patience: int) -> tuple[Ints, Ints]:
    """Half-open index ranges of stays inside; short absences are bridged."""
    rows = np.flatnonzero(inside)
    if not len(rows):
        return rows, rows
    breaks = np.flatnonzero(np.diff(frame[rows]) > patience + 1) + 1
    starts = rows[np.concatenate([[0], breaks])]
    stops = rows[np.concatenate([breaks - 1, [len(rows) - 1]])] + 1
    return starts, stops


CROSSING = columns("line:O frame:<i8 time:<f8 id:<i8 to:O x:<f8 y:<f8 speed:<f8")
"""One row per crossing: seconds, the side that is reached as seen along the line, place in metres, metres a second."""


def line_crossings(line: Line, trajectory: Rows, frame_rate: float, band: float) -> Rows:
    """Crossings of a line, CROSSING (n,), by time.

    A crossing and the next one back count only where the track goes farther than `band` metres from the line between
    them: a person who stands on it does not cross it again and again.
    """
    found = []
    for stay in (stay for track in by_track(trajectory) for stay in stays(track, frame_rate)):
        ground = ground_of(stay)
        kept: list[tuple[int, float, int]] = []
        for row, share, side in _intersections(line, ground):
            since = ground[kept[-1][0] + 1 : row + 1] if kept else ground[:0]
            if kept and kept[-1][2] != side and line.distance(since).max(initial=0.0) <= band:
                kept.pop()
            else:
                kept.append((row, share, side))
        for row, share, side in kept:
            step = stay["frame"][row + 1] - stay["frame"][row]
            frame = stay["frame"][row] + share * step
            x, y = ground[row] + share * (ground[row + 1] - ground[row])
            speed = float(np.hypot(*(ground[row + 1] - ground[row]))) * frame_rate / step
            reached = "left" if side > 0 else "right"
            place = (round(float(x), 4), round(float(y), 4), round(speed, 4))
            found.append((line.name, int(np.ceil(frame)), frame / frame_rate, int(stay["id"][0]), reached, *place))
    return np.sort(np.array(found, CROSSING), order=["time", "id"])


def _intersections(line: Line, ground: Floats) -> list[tuple[int, float, int]]:
    """Steps that intersect the line: row before, share of the step, and side reached (1 left, -1 right)."""
    start, way = line.points[:-1], np.diff(line.points, axis=0)
    step = np.diff(ground, axis=0)
    cross = step[:, None, 0] * way[None, :, 1] - step[:, None, 1] * way[None, :, 0]
    to = start[None] - ground[:-1, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (to[..., 0] * way[None, :, 1] - to[..., 1] * way[None, :, 0]) / cross
        along = (to[..., 0] * step[:, None, 1] - to[..., 1] * step[:, None, 0]) / cross
    hit = (cross != 0) & (share >= 0) & (share < 1) & (along >= 0) & (along <= 1)
    rows, segments = np.nonzero(hit)
    order = np.lexsort((share[rows, segments], rows))
    return [
        (int(rows[k]), float(share[rows[k], segments[k]]), -1 if cross[rows[k], segments[k]] > 0 else 1) for k in order
    ]
