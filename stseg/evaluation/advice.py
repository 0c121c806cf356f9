"""The reading of a truth under which tracks would match it: another unit, axes exchanged, frames or ground moved."""

import cmath
import math
from collections.abc import Iterator

import numpy as np
from scipy.spatial import cKDTree

from stseg.arrays import Rows, ground_of
from stseg.errors import FormatError
from stseg.evaluation.alignment import best_motion, moved_rows, number_met, places_by_frame, sampled
from stseg.geometry import Grid

_MATCHING, _GAIN = 0.5, 0.3
"""Least share of the truth's rows that meet tracks under a reading that is named, and least gain over the given one."""
_MOVED_MATCHING = 0.75
"""The same where the truth is turned and scaled at will: that fits half of any two crowds."""
_ALIEN_SHARE = 0.05
"""Share of the truth's rows that meet tracks below which it may be of another recording."""
_UNITS = {"": 1.0, "in millimetres": 1e-3, "in centimetres": 1e-2, "in kilometres": 1e3, "in feet": 0.3048}
_AXES = {"": (1, 1), "with x negated": (-1, 1), "with y negated": (1, -1), "with x and y exchanged": (1, 1)}
_PAIRED_ROWS = 500, 20_000
"""Rows of the truth and of the tracks that are compared in search of an offset in frames."""
_DELAYS = range(-10, 11)
"""Frames by which a truth is tried to be early or late."""
_DELAYED = 0.9
"""Distance of a delayed truth to the tracks, by that of the given one, at which the delay is named."""
_OUTSIDE_SHARE = 0.01
"""Share of the truth's rows outside the area above which that is said."""
_FEW_ROWS = 50
"""Rows of a truth below which no other reading is named: of so many, one fits a few rows by chance."""
_LEAST_EXTENT = 1.0
"""Least spread of a truth that was scaled onto the tracks, gates: a truth shrunk to a point meets what stands still."""


def reading_advice(truth: Rows, trajectory: Rows, gate: float) -> str | None:
    """One sentence that names the reading of a truth that tracks would match; None where the given one does.

    Truth and trajectory are as `stseg.evaluation.evaluate` takes them; a row meets a track within the gate, metres.
    """
    truth = sampled(truth)
    if not len(truth) or not len(trajectory):
        return None
    tree, given = cKDTree(places_by_frame(trajectory, gate)), 0.0
    best, words = 0.0, ""
    for reading, rows in _readings(truth, trajectory, gate):
        share = number_met(tree, rows, gate) / len(truth)
        given = given if reading else share
        if share > best + 1e-9 and ("turned" not in reading or share > _MOVED_MATCHING):
            best, words = share, reading
    if best < max(_MATCHING, given + _GAIN):
        alien = "tracks meet hardly a row of the truth: is it of this recording, with its frames, and in metres?"
        return alien if given < _ALIEN_SHARE else None
    return f"tracks meet {100 * given:.0f} % of the truth's rows, and {100 * best:.0f} % if the truth is {words}"


def outside_advice(truth: Rows, grid: Grid) -> str | None:
    """One sentence where much of a truth lies outside the area of a run, of whose people it counts all."""
    outside = float((~grid.contains(ground_of(truth))).mean()) if len(truth) else 0.0
    if outside <= _OUTSIDE_SHARE:
        return None
    words = "lie outside the area of the run, where nobody is tracked, and count as missed"
    return f"{100 * outside:.0f} % of the truth's rows {words}: --area, or a truth without them, leaves them out"


def delay_advice(truth: Rows, trajectory: Rows, gate: float) -> str | None:
    """One sentence that names the frames by which a truth that tracks meet is early or late; None where it is not.

    Arguments are those of `reading_advice`. A row has the distance of the nearest track of its frame, a gate at most.
    """
    frame, tree = truth["frame"], cKDTree(places_by_frame(trajectory, gate))
    truth = sampled(truth[(frame >= trajectory["frame"].min()) & (frame <= trajectory["frame"].max())])
    mean = {}
    for delay in sorted(_DELAYS, key=abs):
        later = truth.copy()
        later["frame"] += delay
        distance, _ = tree.query(places_by_frame(later, gate), distance_upper_bound=gate)
        mean[delay] = np.minimum(distance, gate).mean()
    best = min(mean, key=mean.__getitem__)
    if len(truth) < _FEW_ROWS or mean[best] >= _DELAYED * mean[0]:
        return None
    distances = f"{mean[best]:.2f} m instead of {mean[0]:.2f} m from the truth"
    return f"tracks are {distances} if that is counted from frame {-best:+d}: is it late, or the video?"


def _readings(truth: Rows, trajectory: Rows, gate: float) -> Iterator[tuple[str, Rows]]:
    """The truth as it is given, first and without words, and as other readings have it, the simplest first."""
    for axes, signs in _AXES.items():
        for unit, scale in _UNITS.items():
            rows, ground = truth.copy(), scale * ground_of(truth) * signs
            rows["x"], rows["y"] = (ground[:, ::-1] if "exchanged" in axes else ground).T
            yield " ".join(filter(None, (unit, axes))), rows
            if len(truth) < _FEW_ROWS:
                return
    if offset := _offset(truth, trajectory, gate):
        later = truth.copy()
        later["frame"] += offset
        yield f"counted from frame {-offset:+d}", later
    for axes in ("", "with y negated"):
        mirrored = truth.copy()
        mirrored["y"] *= -1 if axes else 1
        try:
            motion = best_motion(trajectory, mirrored, gate, "similarity")
        except FormatError:  # they share no frames
            return
        rows = moved_rows(mirrored, motion)
        turn, scale = math.degrees(cmath.phase(motion.factor)), abs(motion.factor)
        if ground_of(rows).std(axis=0).max() > _LEAST_EXTENT * gate:
            moved = f"turned by {round(turn)} degrees, scaled by {scale:.2g} and shifted"
            yield (f"{axes}, {moved}" if axes else f"{moved} (--align)"), rows


def _offset(truth: Rows, trajectory: Rows, gate: float) -> int:
    """The most frequent number of frames between rows of the truth and tracks at the same place; 0 for none."""
    few, many = (rows[:: -(-len(rows) // most)] for rows, most in zip((truth, trajectory), _PAIRED_ROWS, strict=True))
    meetings = cKDTree(ground_of(many)).query_ball_point(ground_of(few), gate)
    later = np.concatenate(
        [np.zeros(0, np.int64), *(many["frame"][met] - row["frame"] for met, row in zip(meetings, few, strict=True))]
    )
    offsets, counts = np.unique(later, return_counts=True)
    return int(offsets[counts.argmax()]) if len(counts) else 0
