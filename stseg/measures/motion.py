"""Speeds of tracks with their uncertainty, distances between people, and fields of density and flow."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from stseg.arrays import Floats, Ints, Rows, by_track, columns, ground_of
from stseg.measures.areas import stays

TRACK_MEASURE = columns(
    "id:<i8 first:<i8 last:<i8 seconds:<f8 distance:<f8 mean_speed:<f8 "
    "median_speed:<f8 fastest:<f8 standing:<f8 score:<f8"
)
"""One row per track: metres walked, metres a second over one second each, share of time below 0.2 m/s, nats."""
SPACING = columns("frame:<i8 time:<f8 people:<i8 nearest:<f8 mean_nearest:<f8")
"""One row per frame with two people or more: smallest and mean distance to the nearest person, metres."""
CELL = columns("x:<f8 y:<f8 density:<f8 speed:<f8 flow_x:<f8 flow_y:<f8")
"""One row per bin of the ground: centre, metres; people a square metre; mean speed, m/s; flow, people a metre and
second."""
MOTION = columns(
    "frame:<i8 id:<i8 speed:<f8 speed_deviation:<f8 heading:<f8 heading_deviation:<f8 "
    "acceleration:<f8 acceleration_deviation:<f8"
)
"""One row per person and frame, with standard deviations: metres a second; radians from x towards y; metres a second
squared along the heading. nan where a track has fewer than three rows nearby."""
_STANDING = 0.2
_ERRORS_LAST = 0.5
"""Time in which the correlation of errors of smoothed places falls by e, seconds: in three recordings 62 to 82 % of the
true velocities, and 65 to 90 % of the accelerations, are then within the stated deviation."""
_ANY_HEADING = np.pi / 3**0.5
"""Standard deviation of a heading of which nothing is known, radians."""


def motions(trajectory: Rows, frame_rate: float) -> Rows:
    """Speed, heading and acceleration of every row, MOTION (n,), by a parabola through the second around it."""
    rows: list[tuple[float, ...]] = []
    for track in by_track(trajectory):
        frame, half = track["frame"], max(1, round(frame_rate / 2))
        first, stop = np.searchsorted(frame, frame - half), np.searchsorted(frame, frame + half, "right")
        for k, (begin, end) in enumerate(zip(first.tolist(), stop.tolist(), strict=True)):
            piece = track[begin:end]
            rows.append((frame[k], track["id"][k], *_motion(piece, piece["frame"] - frame[k], frame_rate)))
    return np.array(rows, MOTION)


def _motion(piece: Rows, offset: Ints, frame_rate: float) -> Sequence[float]:
    """Columns of MOTION from `speed` on, by rows at frames `offset` from the one in question."""
    if len(piece) < 3:
        return (np.nan,) * 6
    weights, growth = _parabola(tuple(offset.tolist()), frame_rate)
    velocity, acceleration = weights @ ground_of(piece)
    xx, xy, yy = (float(piece[name].mean()) for name in ("xx", "xy", "yy"))
    speed, heading = float(np.hypot(*velocity)), float(np.arctan2(velocity[1], velocity[0]))
    ahead, across = np.array([np.cos(heading), np.sin(heading)]), np.array([-np.sin(heading), np.cos(heading)])
    spread, side = (max(float(one @ [[xx, xy], [xy, yy]] @ one), 0.0) ** 0.5 for one in (ahead, across))
    turning = min(side * growth[0] / max(speed, 1e-9), _ANY_HEADING)
    return speed, spread * growth[0], heading, turning, float(acceleration @ ahead), spread * growth[1]


@lru_cache(1024)
def _parabola(offset: tuple[int, ...], frame_rate: float) -> tuple[Floats, Sequence[float]]:
    """Weights (2, n) of places in velocity and acceleration at 0, and their deviations for places that err by 1."""
    seconds = np.array(offset) / frame_rate
    weights = np.linalg.pinv(np.stack([np.ones(len(seconds)), seconds, seconds**2 / 2], -1))[1:]
    alike = np.exp(-np.abs(seconds[:, None] - seconds) / _ERRORS_LAST)
    return weights, np.sqrt(np.diag(weights @ alike @ weights.T)).tolist()


def track_measures(trajectory: Rows, frame_rate: float) -> Rows:
    """Duration, distance and speeds of every track while it is there, TRACK_MEASURE (n,)."""
    rows = []
    for track in by_track(trajectory):
        speed, frame = np.hypot(*velocities(track, frame_rate).T), track["frame"]
        present = stays(track, frame_rate)
        seconds = sum(int(stay["frame"][-1] - stay["frame"][0] + 1) for stay in present) / frame_rate
        distance = sum(_distance(stay, frame_rate) for stay in present)
        speeds = (speed.mean(), np.median(speed), speed.max(), (speed < _STANDING).mean())
        rows.append((track["id"][0], frame[0], frame[-1], seconds, distance, *speeds, track["score"].mean()))
    return np.array(rows, TRACK_MEASURE)


def _distance(track: Rows, frame_rate: float) -> float:
    """Way of a track in steps of half a second, metres."""
    sampled = np.unique(np.append(np.arange(0, len(track), max(1, round(frame_rate / 2))), len(track) - 1))
    return float(np.hypot(*np.diff(ground_of(track)[sampled], axis=0).T).sum())


def velocities(track: Rows, frame_rate: float) -> Floats:
    """Velocity of one track at each row over one second around it, metres a second, float64 (n, 2)."""
    ground, half = ground_of(track), max(1, round(frame_rate / 2))
    frame = track["frame"].astype(float)
    before, after = np.clip(frame - half, frame[0], frame[-1]), np.clip(frame + half, frame[0], frame[-1])
    span = np.maximum(after - before, 1) / frame_rate
    moved = [np.interp(after, frame, axis) - np.interp(before, frame, axis) for axis in ground.T]
    return np.asarray(np.stack(moved, -1) / span[:, None])


def spacings(trajectory: Rows, frame_rate: float) -> Rows:
    """Distances between people, SPACING (n,)."""
    table, rows = trajectory[np.argsort(trajectory["frame"], kind="stable")], []
    for people in np.split(table, np.flatnonzero(np.diff(table["frame"])) + 1):
        if len(people) > 1:
            ground = ground_of(people)
            away = np.hypot(*np.moveaxis(ground[:, None] - ground[None], -1, 0))
            np.fill_diagonal(away, np.inf)
            nearest = away.min(axis=1)
            rows.append(
                (people["frame"][0], people["frame"][0] / frame_rate, len(people), nearest.min(), nearest.mean())
            )
    return np.array(rows, SPACING)


def flow_field(
    trajectory: Rows, frames: Ints, frame_rate: float, x: tuple[float, float], y: tuple[float, float], side: float
) -> Rows:
    """Density, speed and flow by square bins of the ground, CELL (bins,)."""
    wide, tall = (max(1, int(np.ceil((high - low) / side - 1e-9))) for low, high in (x, y))
    tracks = by_track(trajectory)
    table = np.concatenate(tracks) if tracks else trajectory[:0]
    velocity = np.concatenate([np.zeros((0, 2)), *(velocities(track, frame_rate) for track in tracks)])
    column, row = (np.floor((table[name] - low) / side) for name, low in (("x", x[0]), ("y", y[0])))
    inside = (column >= 0) & (column < wide) & (row >= 0) & (row < tall)
    index = (row * wide + column)[inside].astype(np.int64)
    count = np.bincount(index, minlength=wide * tall)
    scale = max(len(frames), 1) * side**2
    cells = np.zeros(wide * tall, CELL)
    cells["x"] = np.tile(x[0] + side * (np.arange(wide) + 0.5), tall)
    cells["y"] = np.repeat(y[0] + side * (np.arange(tall) + 0.5), wide)
    cells["density"] = count / scale
    cells["speed"] = np.bincount(index, np.hypot(*velocity[inside].T), wide * tall) / np.maximum(count, 1)
    cells["flow_x"] = np.bincount(index, velocity[inside, 0], wide * tall) / scale
    cells["flow_y"] = np.bincount(index, velocity[inside, 1], wide * tall) / scale
    return cells
