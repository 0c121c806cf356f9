"""Speeds of tracks, distances between people, and fields of density and flow."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Floats, Ints, Rows
from stseg.measures.areas import by_track, stays

TRACK_MEASURE = np.dtype(
    [("id", "<i8"), ("first", "<i8"), ("last", "<i8"), ("seconds", "<f8"), ("distance", "<f8"), ("mean_speed", "<f8"),
     ("median_speed", "<f8"), ("fastest", "<f8"), ("standing", "<f8"), ("score", "<f8")]
)  # fmt: skip
"""One row per track: metres walked, metres a second over one second each, share of time below 0.2 m/s, nats."""
SPACING = np.dtype([("frame", "<i8"), ("time", "<f8"), ("people", "<i8"), ("nearest", "<f8"), ("mean_nearest", "<f8")])
"""One row per frame with two people or more: smallest and mean distance to the nearest person, metres."""
CELL = np.dtype(
    [("x", "<f8"), ("y", "<f8"), ("density", "<f8"), ("speed", "<f8"), ("flow_x", "<f8"), ("flow_y", "<f8")]
)
"""One row per bin of the ground: centre, metres; people a square metre; mean speed, m/s; flow, people a metre and
second."""
_STANDING = 0.2


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
    return float(np.hypot(*np.diff(_ground(track)[sampled], axis=0).T).sum())


def velocities(track: Rows, frame_rate: float) -> Floats:
    """Velocity of one track at each row over one second around it, metres a second, float64 (n, 2)."""
    ground, half = _ground(track), max(1, round(frame_rate / 2))
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
            ground = _ground(people)
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
    cells["x"], cells["y"] = (
        np.tile(x[0] + side * (np.arange(wide) + 0.5), tall),
        np.repeat(y[0] + side * (np.arange(tall) + 0.5), wide),
    )
    cells["density"] = count / scale
    cells["speed"] = np.bincount(index, np.hypot(*velocity[inside].T), wide * tall) / np.maximum(count, 1)
    cells["flow_x"] = np.bincount(index, velocity[inside, 0], wide * tall) / scale
    cells["flow_y"] = np.bincount(index, velocity[inside, 1], wide * tall) / scale
    return cells


def _ground(track: Rows) -> Floats:
    return np.stack([track["x"], track["y"]], -1)
