"""Short gaps of tracks are filled by linear interpolation, and places smoothed (Rauch, Tung and Striebel 1965).

The motion model is that of the track filter; each row is a measurement with its own covariance C = L L', except for
those of filled gaps, which are predicted, with nan as raw_x and raw_y. Most of a measurement's error lasts
(`stseg.noise.lasting_error`): it is L u with a state u of its own, x, y, vx, vy, u1, u2 in all, where

    u' = r u + N(0, (1 - r^2) I),  r = exp(-t / tau),    measured place = place + sqrt(b^2) L u + N(0, a^2 C)

(an augmented state, Bar-Shalom, Li and Kirubarajan 2001, section 8.2). So a place is never surer than its lasting
error allows, however many rows there are. All tracks are smoothed at the same time: the first rows of all, then the
second rows, and so on.
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

import numpy as np

from stseg.arrays import Floats, Ints, Rows, ground_of
from stseg.config import MotionConfig, TrackingConfig
from stseg.geometry.distances import distances
from stseg.noise.lasting_error import PLACE_ERROR
from stseg.records.tables import TRAJECTORY
from stseg.tracking.filter.motion_model import augmented_noise, augmented_transition
from stseg.tracking.filter.prediction import DRIFT_SPEED
from stseg.tracking.filter.tentative_tracks import EXCLUSION_RADIUS
from stseg.tracking.row_groups import rows_of_tracks

_ROWS_AT_ONCE = 8192
"""Rows that are smoothed at a time: each takes 2 kB meanwhile, and of a day there are millions."""


def filled_gaps(trajectory: Rows, interpolated: Rows) -> Rows:
    """The trajectory with some of its interpolated rows, sorted by frame, then id."""
    parts = trajectory, interpolated
    order = np.lexsort([np.concatenate([part[name] for part in parts]) for name in ("id", "frame")])
    place, rows = np.empty_like(order), np.empty(len(order), TRAJECTORY)
    place[order] = np.arange(len(order))
    rows[place[: len(trajectory)]], rows[place[len(trajectory) :]] = parts
    return rows


def interpolated_rows(trajectory: Rows, frame_rate: float, config: TrackingConfig) -> Rows:
    """TRAJECTORY rows in gaps of at most `tracking.interpolation_gap`.

    They have extent 0, no measured place or size, and a covariance that grows with the time to the nearest detection.
    Longer gaps stay open: the path there is unknown.
    """
    order = np.lexsort((trajectory["frame"], trajectory["id"]))
    step, same = np.diff(trajectory["frame"][order]), np.diff(trajectory["id"][order]) == 0
    gaps = np.flatnonzero(same & (step > 1) & (step <= config.interpolation_gap * frame_rate + 1))
    ends = zip(trajectory[order[gaps]], trajectory[order[gaps + 1]], strict=True)
    return np.concatenate([np.zeros(0, TRAJECTORY), *(_between(before, after, frame_rate) for before, after in ends)])


def apart_from(rows: Rows, trajectory: Rows) -> Rows:
    """Rows apart from all rows of the trajectory in the same frame: two bodies need two places."""
    free = np.ones(len(rows), bool)
    by_frame = np.argsort(trajectory["frame"], kind="stable")
    frame, order = trajectory["frame"][by_frame], np.argsort(rows["frame"], kind="stable")
    for of_frame in np.split(order, np.flatnonzero(np.diff(rows["frame"][order])) + 1) if len(rows) else ():
        first, stop = np.searchsorted(frame, rows["frame"][of_frame[0]] + np.arange(2))
        away = distances(ground_of(rows[of_frame]), ground_of(trajectory[by_frame[first:stop]]))
        free[of_frame] = (away >= EXCLUSION_RADIUS).all(axis=1)
    return np.asarray(rows[free])


def _between(before: np.void, after: np.void, frame_rate: float) -> Rows:
    frames = np.arange(before["frame"] + 1, after["frame"])
    filled = np.zeros(len(frames), TRAJECTORY)
    fraction = (frames - before["frame"]) / (after["frame"] - before["frame"])
    filled["frame"], filled["id"] = frames, before["id"]
    for name in ("x", "y", "xx", "xy", "yy", "score"):
        filled[name] = before[name] + fraction * (after[name] - before[name])
    away = np.minimum(frames - before["frame"], after["frame"] - frames) / frame_rate
    filled["xx"] += (DRIFT_SPEED * away) ** 2
    filled["yy"] += (DRIFT_SPEED * away) ** 2
    for name in ("raw_x", "raw_y", "height", "width"):
        filled[name] = np.nan
    filled["views"] = before["views"]
    return filled


def smooth_places(trajectory: Rows, frame_rate: float, model: MotionConfig) -> None:
    """Smooth x, y and their covariance in TRAJECTORY rows (n,), sorted by frame.

    The columns raw_x and raw_y stay the detection's; where they are nan, the place is predicted.
    """
    if not len(trajectory):
        return

    def measured(index: Ints) -> _Measured:
        rows = trajectory[index]
        noise = np.array([[rows["xx"], rows["xy"]], [rows["xy"], rows["yy"]]]).transpose(2, 0, 1)
        return rows["frame"] / frame_rate, np.column_stack([rows["raw_x"], rows["raw_y"]]), noise

    for rows, ground, covariance in _smoothed_parts(measured, rows_of_tracks(trajectory["id"]), model):
        trajectory["x"][rows], trajectory["y"][rows] = ground.T
        for name, value in zip(("xx", "xy", "yy"), covariance.reshape(-1, 4)[:, [0, 1, 3]].T, strict=True):
            trajectory[name][rows] = value


_Measured = tuple[Floats, Floats, Floats]
"""Seconds (n,), places (n, 2) and their covariances (n, 2, 2) of some rows."""


def _smoothed_parts(
    measured: Callable[[Ints], _Measured], tracks: Sequence[Ints], model: MotionConfig
) -> Iterator[tuple[Ints, Floats, Floats]]:
    """Rows of each part, the last first, with their smoothed places and covariances.

    What was `measured` in a row is no longer asked for once it is smoothed.
    """
    order, number = _by_turn(tracks)
    parts, begun = _parts(number), list[_States | None]([None])

    def filtered(k: int) -> _Filtered:
        seconds, ground, noise = measured(order[parts[k][1]])
        return _filtered(seconds, ground[:, :, None], noise, number[parts[k][0]], begun[k], model)

    for k, (turns, _) in enumerate(parts[:-1]):
        (state, spread), *_ = filtered(k)
        begun.append((state[-number[turns][-1] :].copy(), spread[-number[turns][-1] :].copy()))
    after = None
    for k, (turns, rows) in reversed(list(enumerate(parts))):
        state, spread = _smoothed(filtered(k), number[turns], after)
        first = int(number[turns][0])
        after, part = (state[:first], spread[:first]), slice(first if k else 0, None)  # the one before has the others
        yield order[rows][part], state[part, :2, 0], spread[part, :2, :2]


_States = tuple[Floats, Floats]
"""States of rows, float64 (n, 6, 1), and their covariances, float64 (n, 6, 6)."""
_Filtered = tuple[_States, _States, Floats]
"""States of the rows of some turns, and those before the row's measurement; the transitions to all but the first."""


def _parts(number: Ints) -> list[tuple[slice, slice]]:
    """Turns and rows of parts of about `_ROWS_AT_ONCE`; each begins with the last turn of the one before."""
    stop = np.cumsum(number)
    cuts = np.unique([*np.searchsorted(stop, np.arange(_ROWS_AT_ONCE, stop[-1], _ROWS_AT_ONCE)), len(stop) - 1])
    return [(slice(a, b + 1), slice(stop[a] - number[a], stop[b])) for a, b in pairwise([0, *cuts.tolist()])]


def _steps(number: Ints) -> tuple[Ints, list[tuple[slice, slice]]]:
    """The row before each row after the first turn, and the rows of each such turn, after those before them."""
    start, before = np.cumsum(number), np.arange(number[0], number.sum()) - np.repeat(number[:-1], number[1:])
    turns = zip(start.tolist(), number.tolist(), number[1:].tolist(), strict=False)
    return before, [(slice(k - n, k - n + m), slice(k, k + m)) for k, n, m in turns]


def _filtered(
    seconds: Floats, ground: Floats, noise: Floats, number: Ints, begun: _States | None, model: MotionConfig
) -> _Filtered:
    """Filter some turns of rows, of which the first is known, or that of all tracks."""
    first, (before, steps) = int(number[0]), _steps(number)
    motion, turn = _motions(seconds[first:] - seconds[before], model)
    matrix, white = _measurement(noise), PLACE_ERROR.white * noise
    state, spread = np.zeros((len(seconds), 6, 1)), np.zeros((len(seconds), 6, 6))
    is_measured, ground = np.isfinite(ground[:, 0, 0]), np.nan_to_num(ground)
    if begun is None:
        state[:first, :2], spread[:first] = ground[:first], _first_spread(noise[:first], matrix[:first], model)
    else:
        state[:first], spread[:first] = begun
    predicted, ahead = state.copy(), spread.copy()
    for old, new in steps:
        rows = motion[new.start - first : new.stop - first]
        predicted[new] = rows @ state[old]
        ahead[new] = rows @ spread[old] @ rows.transpose(0, 2, 1) + turn[new.start - first : new.stop - first]
        crossed = ahead[new] @ matrix[new].transpose(0, 2, 1)
        gain = crossed @ np.linalg.inv(matrix[new] @ crossed + white[new]) * is_measured[new, None, None]
        state[new] = predicted[new] + gain @ (ground[new] - matrix[new] @ predicted[new])
        spread[new] = ahead[new] - gain @ matrix[new] @ ahead[new]
    return (state, spread), (predicted, ahead), motion


def _smoothed(filtered: _Filtered, number: Ints, after: _States | None) -> _States:
    """Smooth some turns of rows; the last becomes as the turns after it have it, where there are any."""
    (state, spread), (predicted, ahead), motion = filtered
    first, (before, steps) = int(number[0]), _steps(number)
    gains = spread[before] @ motion.transpose(0, 2, 1) @ np.linalg.inv(ahead[first:])
    if after is not None:
        state[-number[-1] :], spread[-number[-1] :] = after
    for old, new in steps[::-1]:
        gain = gains[new.start - first : new.stop - first]
        state[old] += gain @ (state[new] - predicted[new])
        spread[old] += gain @ (spread[new] - ahead[new]) @ gain.transpose(0, 2, 1)
    return state, spread


def _measurement(noise: Floats) -> Floats:
    """Matrix of a measured place by the state, from covariances (n, 2, 2): float64 (n, 2, 6)."""
    matrix = np.zeros((len(noise), 2, 6))
    matrix[:, :, :2] = np.eye(2)
    # The Cholesky factor in closed form: it takes a covariance without rank, too, as of a place that is said exactly.
    first = np.sqrt(np.maximum(noise[:, 0, 0], 0.0))
    slant = np.divide(noise[:, 0, 1], first, out=np.zeros_like(first), where=first > 0)
    second = np.sqrt(np.maximum(noise[:, 1, 1] - slant**2, 0.0))
    matrix[:, :, 4:] = np.stack([first, 0 * first, slant, second], 1).reshape(-1, 2, 2)
    matrix[:, :, 4:] *= np.sqrt(PLACE_ERROR.lasting)
    return matrix


def _first_spread(noise: Floats, matrix: Floats, model: MotionConfig) -> Floats:
    """Covariance of the state after a first row, which alone says where the track is, float64 (n, 6, 6)."""
    spread = np.zeros((len(noise), 6, 6))
    spread[:, :2, :2], spread[:, :2, 4:] = noise, -matrix[:, :, 4:]
    spread[:, 4:, :2], spread[:, 4:, 4:] = -matrix[:, :, 4:].transpose(0, 2, 1), np.eye(2)
    spread[:, [2, 3], [2, 3]] = model.speed_spread**2
    return spread


def _by_turn(tracks: Sequence[Ints]) -> tuple[Ints, Ints]:
    """The first rows of all tracks, then their second rows, and so on, each of the longest first; number of each."""
    longest_first = sorted(tracks, key=len, reverse=True)
    turn = np.concatenate([np.arange(len(rows)) for rows in longest_first])
    return np.concatenate(longest_first)[np.argsort(turn, kind="stable")], np.bincount(turn)


def _motions(seconds: Floats, model: MotionConfig) -> tuple[Floats, Floats]:
    """Transitions and process noise over some times (n,), float64 (n, 6, 6)."""
    steps, which = np.unique(seconds, return_inverse=True)
    motions = np.array([augmented_transition(step) for step in steps.tolist()]).reshape(-1, 6, 6)
    noises = np.array([augmented_noise(step, model) for step in steps.tolist()]).reshape(-1, 6, 6)
    return motions[which], noises[which]
