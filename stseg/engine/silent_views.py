"""Views that are silent, contradict the others, or lose evidence during a run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Floats, Ints, Rows
from stseg.model.ghost_reasons import says

_ENOUGH = 30
"""Candidates that a statement on a view needs."""
_SILENT_SHARE = 0.1
"""Share of the run for which a view may be silent without a break before there is a warning."""


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
