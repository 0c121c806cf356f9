"""What a run says of itself: people a minute, why candidates were dropped, which view is silent or drifts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import AnyArray, Bytes, Flags, Floats, Ints, Rows

DENIED, OTHERS, TOO_LITTLE = 0, 1, 2
"""Reasons of `ghost_reasons`."""

REASONS = (
    "a view sees nobody there",
    "what supports it belongs to people nearby",
    "no view denies it, but too little supports it",
)
"""The same in words."""

_AGAINST = -1.0  # nats from which on something speaks against a candidate
_PRICE = -3.0  # nats, of one more person where there is nobody to learn it from
_SAYS = 0.25  # nats from which on a view says anything; of people hidden from it a detector's view says almost nothing
_ENOUGH = 30  # candidates that a statement on a view needs
_SILENT_SHARE = 0.1  # of the run that a view may be silent at a stretch before anybody is told


def people_per_minute(frames: Ints, trajectory: Rows, frame_rate: float) -> Floats:
    """Mean number of people in each minute of the run that has frames, the last one perhaps shorter.

    Parameters
    ----------
    frames : int64 (time,)
        The run's frames.
    trajectory : TRAJECTORY (n,)
    frame_rate
        Frames per second.

    Returns
    -------
    float64 (minute,)
    """
    if not len(frames):
        return np.zeros(0)
    length = max(1, round(60 * frame_rate))
    minute, rows = (frames - frames[0]) // length, (trajectory["frame"] - frames[0]) // length
    there = np.bincount(minute)
    people = np.bincount(rows, minlength=len(there))[: len(there)]
    return np.asarray(people[there > 0] / there[there > 0], float)


def ground_by_views(views: Bytes, inside: Flags, cameras: int) -> Floats:
    """Share of the ground that counts which 0, 1, 2, ... views see at some height, float64 (cameras + 1,).

    Parameters
    ----------
    views : uint8 (plane, y, x)
        Number of views that see each cell.
    inside : bool (y, x)
        The cells that count.
    cameras
        How many there are.
    """
    seen = views.max(axis=0)[inside]
    return np.asarray(np.bincount(seen, minlength=cameras + 1) / max(len(seen), 1), float)


@dataclass(frozen=True)
class GhostReasons:
    """Why candidates are ghosts.

    Attributes
    ----------
    ghosts : rows (n,) with frame, x, y, evidence, parts
    reason : int64 (n,)
        What weighed most against it: `DENIED`, `OTHERS` or `TOO_LITTLE`.
    denies : bool (n, view)
        Views that see nobody there, whatever weighed most.
    """

    ghosts: Rows
    reason: Ints
    denies: Flags

    def counts(self) -> list[int]:
        """Number of ghosts of each reason."""
        return [int(count) for count in np.bincount(self.reason, minlength=len(REASONS))]


def ghost_reasons(candidates: Rows) -> GhostReasons:
    """Name for every ghost what weighed most against it.

    Its evidence is what all views say, less the price of one more person, less what the people who are there already
    lose to it. The price is learned from the people: the median of what their evidence is short of their parts.

    Parameters
    ----------
    candidates : rows (n,) with status, evidence, parts
        As in the run file's /ghosts.
    """
    parts = np.nan_to_num(candidates["parts"].astype(float))
    short = candidates["evidence"] - parts.sum(axis=1)
    ghost, person = candidates["status"] == 0, candidates["status"] == 1
    price = float(np.median(short[person])) if person.any() else _PRICE
    parts, lost = parts[ghost], short[ghost] - price
    denies, against = parts <= _AGAINST, np.minimum(parts, 0).sum(axis=1)
    reason = np.full(len(parts), TOO_LITTLE)
    reason[lost <= _AGAINST] = OTHERS
    reason[denies.any(axis=1) & (against <= lost)] = DENIED
    return GhostReasons(candidates[ghost], reason, denies)


def says(parts: AnyArray) -> Flags:
    """Where a view says anything for or against a candidate, bool of the same shape."""
    return np.asarray(np.abs(parts) >= _SAYS)


def view_warnings(cameras: Sequence[str], candidates: Rows, frames: Ints, frame_rate: float) -> list[str]:
    """Views that say nothing, fall silent, deny what the others agree on, or come to speak less and less.

    Parameters
    ----------
    cameras
        Their names.
    candidates : rows (n,) with frame, status, parts
    frames : int64 (time,)
        The run's frames.
    frame_rate
        Frames per second.
    """
    if not len(candidates) or not len(frames):
        return []
    parts = np.nan_to_num(candidates["parts"])
    person = candidates["status"] == 1
    warnings = []
    for view, name in enumerate(cameras):
        own = parts[:, view]
        if not says(own).any():
            warnings.append(f"view {name} says nothing of any candidate: is it blind, or its calibration wrong?")
            continue
        warnings += _silence(name, candidates["frame"], own, frames, frame_rate)
        warnings += _doubts(name, candidates["frame"][person], own[person], frames)
    return warnings


def _silence(name: str, frame: Ints, own: Floats, frames: Ints, frame_rate: float) -> list[str]:
    """The longest stretch in which the others had something to say and this view had not."""
    spoke = np.unique(frame[says(own)])
    asked = np.unique(frame)
    gaps = np.concatenate([[frames[0] - 1], spoke, [frames[-1] + 1]])
    longest = int(np.argmax(np.diff(gaps)))
    start, stop = int(gaps[longest]) + 1, int(gaps[longest + 1])
    missed = int(((asked >= start) & (asked < stop)).sum())
    if missed < max(_ENOUGH, _SILENT_SHARE * len(frames)):
        return []
    seconds = (stop - start) / frame_rate
    return [f"view {name} says nothing in frames {start} to {stop - 1} ({seconds:.0f} s): did its stream end?"]


def _doubts(name: str, frame: Ints, own: Floats, frames: Ints) -> list[str]:
    """What a view says of people whom it can see, at the beginning and at the end."""
    told = says(own)
    frame, own = frame[told], own[told]
    if len(own) >= _ENOUGH and np.median(own) < 0:
        return [f"view {name} denies most people that the others see: is its calibration wrong?"]
    third = (frames[-1] - frames[0]) / 3
    early, late = own[frame < frames[0] + third], own[frame > frames[-1] - third]
    if min(len(early), len(late)) >= _ENOUGH and np.median(late) < 0.5 * np.median(early):
        first, last = np.median(early), np.median(late)
        return [f"view {name} drifts: it says {first:.1f} nats of a person at first, {last:.1f} at the end"]
    return []
