"""All measures of a run's tracks."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Ints, Rows, columns
from stseg.geometry import Grid
from stseg.measures.areas import COUNT, CROSSING, VISIT, Areas, line_crossings, standard_error, zone_counts, zone_visits
from stseg.measures.motion import flow_field, motions, spacings, track_measures

_PATIENCE = 1.0
"""Absence that does not end a visit, seconds."""
_BAND = 0.2
"""Distance from a line within which crossing it back cancels a crossing, metres."""
_SIDE = 0.5
"""Side of a bin of density and flow, metres."""
ZONE = columns(
    "zone:O area:<f8 mean_people:<f8 deviation:<f8 most_people:<i8 entries:<i8 exits:<i8 visits:<i8 "
    "mean_dwell:<f8 median_dwell:<f8 mean_density:<f8"
)
"""One row per zone: square metres, people, standard deviation of their mean, seconds, people a square metre."""
LINE = columns("line:O left:<i8 right:<i8 per_minute:<f8 mean_speed:<f8")
"""One row per line: crossings to each side, crossings a minute, metres a second."""


@dataclass(frozen=True, repr=False)
class Measures:
    """Tables of measures, see the records in `stseg.measures`."""

    zones: Rows
    people: Rows
    visits: Rows
    lines: Rows
    crossings: Rows
    tracks: Rows
    motion: Rows
    spacing: Rows
    field: Rows

    def __repr__(self) -> str:
        return f"Measures(rows of {', '.join(f'{name}: {len(rows)}' for name, rows in self.tables().items())})"

    def tables(self) -> dict[str, Rows]:
        """The tables by name."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__}


def measure_tracks(trajectory: Rows, frames: Ints, frame_rate: float, grid: Grid, areas: Areas) -> Measures:
    """Measure tracks in zones, at lines and over the ground.

    Parameters
    ----------
    trajectory : TRAJECTORY (n,)
    frames : int64 (time,)
        Frames of the run.
    frame_rate
        Frames per second.
    grid
        The ground.
    areas
        Zones and lines.
    """
    sizes = [zone.area_on(grid) for zone in areas.zones]
    pairs = zip(areas.zones, sizes, strict=True)
    people = [zone_counts(zone, size, trajectory, frames, frame_rate) for zone, size in pairs]
    visits = [zone_visits(zone, trajectory, frame_rate, _PATIENCE) for zone in areas.zones]
    crossings = [line_crossings(line, trajectory, frame_rate, _BAND) for line in areas.lines]
    shapes = zip(areas.zones, sizes, people, visits, strict=True)
    zones = [_zone(z.name, size, count, stays, standard_error(count, frame_rate)) for z, size, count, stays in shapes]
    minutes = max(len(frames) / frame_rate / 60, 1e-9)
    lines = [_line(line.name, crossed, minutes) for line, crossed in zip(areas.lines, crossings, strict=True)]
    return Measures(
        np.array(zones, ZONE),
        np.concatenate([np.zeros(0, COUNT), *people]),
        np.concatenate([np.zeros(0, VISIT), *visits]),
        np.array(lines, LINE),
        np.concatenate([np.zeros(0, CROSSING), *crossings]),
        track_measures(trajectory, frame_rate),
        motions(trajectory, frame_rate),
        spacings(trajectory, frame_rate),
        flow_field(trajectory, frames, frame_rate, grid.x, grid.y, _SIDE),
    )


def _zone(name: str, area: float, people: Rows, visits: Rows, deviation: float) -> tuple[object, ...]:
    counts = (_of(people["people"], np.mean), deviation, people["people"].max(initial=0))
    flow = (visits["entered"].sum(), visits["left"].sum(), len(visits))
    dwell = (_of(visits["dwell"], np.mean), _of(visits["dwell"], np.median))
    return (name, area, *counts, *flow, *dwell, _of(people["density"], np.mean))


def _line(name: str, crossings: Rows, minutes: float) -> tuple[object, ...]:
    to_left = (crossings["to"] == "left").sum()
    speed = _of(crossings["speed"], np.mean)
    return name, to_left, len(crossings) - to_left, len(crossings) / minutes, speed


def _of(values: Rows, statistic: Callable[..., object]) -> object:
    """A statistic, nan of nothing."""
    return statistic(values) if len(values) else np.nan
