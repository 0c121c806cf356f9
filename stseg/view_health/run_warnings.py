"""Warnings of views that are silent, contradict the others or lose evidence, and of bodies other than configured."""

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Floats, Ints, Rows
from stseg.config import BodyConfig
from stseg.records.ghost_reasons import has_evidence

_LEAST_CANDIDATES = 30
"""Least number of candidates for a statement on a view."""
_SILENT_SHARE = 0.1
"""Share of the run for which a view may be silent without a break before there is a warning."""


def view_warnings(cameras: Sequence[str], candidates: Rows, frames: Ints, frame_rate: float) -> list[str]:
    """Warnings of views without evidence, with gaps, against what the others agree on, or with falling evidence.

    `candidates` (n,) have the columns frame, status, parts; `frames` int64 (time,) are the run's, at frames per second.
    """
    if not len(candidates) or not len(frames):
        return []
    parts = np.nan_to_num(candidates["parts"])
    person = candidates["status"] == 1
    warnings = []
    for view, name in enumerate(cameras):
        evidence = parts[:, view]
        if not has_evidence(evidence).any():
            warnings.append(f"view {name} has no evidence on any candidate: is it blind, or its calibration wrong?")
            continue
        warnings += _silent_interval(name, candidates["frame"], evidence, frames, frame_rate)
        warnings += _weak_support(name, candidates["frame"][person], evidence[person], frames)
    return warnings


def _silent_interval(name: str, frame: Ints, evidence: Floats, frames: Ints, frame_rate: float) -> list[str]:
    """Warning of the longest interval in which other views had evidence and this one had none."""
    active_frames = np.unique(frame[has_evidence(evidence)])
    all_frames = np.unique(frame)
    gaps = np.concatenate([[frames[0] - 1], active_frames, [frames[-1] + 1]])
    longest = int(np.argmax(np.diff(gaps)))
    start, stop = int(gaps[longest]) + 1, int(gaps[longest + 1])
    missed = int(((all_frames >= start) & (all_frames < stop)).sum())
    if missed < max(_LEAST_CANDIDATES, _SILENT_SHARE * len(frames)):
        return []
    seconds = (stop - start) / frame_rate
    frames_named = f"frames {start} to {stop - 1} ({seconds:.0f} s)"
    return [f"view {name} has no evidence in {frames_named}: did it end, fail, or was it excluded?"]


def _weak_support(name: str, frame: Ints, evidence: Floats, frames: Ints) -> list[str]:
    """Warning of a view's negative or falling evidence for people in its view."""
    informative = has_evidence(evidence)
    frame, evidence = frame[informative], evidence[informative]
    if len(evidence) >= _LEAST_CANDIDATES and np.median(evidence) < 0:
        return [f"view {name} denies most people that the others see: is its calibration wrong?"]
    third = (frames[-1] - frames[0]) / 3
    early, late = evidence[frame < frames[0] + third], evidence[frame > frames[-1] - third]
    if min(len(early), len(late)) >= _LEAST_CANDIDATES and np.median(late) < 0.5 * np.median(early):
        first, last = np.median(early), np.median(late)
        return [f"view {name} drifts: its evidence for a person falls from {first:.1f} to {last:.1f} nats"]
    return []


_LEAST_MEASUREMENTS = 30
"""Least number of measurements for a statement."""
_WIDTH_DEVIATIONS = 3.0
"""Spreads from the configured mean beyond which bodies are others than configured."""
_TORN_MISS_RATE = 0.3
"""Learned miss rate above which a view's bodies are torn; clean masks have 0.05 to 0.2."""


def body_warnings(cameras: Sequence[str], trajectory: Rows, rates: Rows, body: BodyConfig) -> list[str]:
    """Warnings of a run's bodies: TRAJECTORY (n,) and learned RATES (m,), against the configured population."""
    return _sizes(trajectory, body) + _torn(cameras, rates)


def _sizes(trajectory: Rows, body: BodyConfig) -> list[str]:
    measured = trajectory[np.isfinite(trajectory["height"]) & np.isfinite(trajectory["width"])]
    if len(measured) < _LEAST_MEASUREMENTS:
        return []
    height, width = (float(np.median(measured[name])) for name in ("height", "width"))
    usual = float(body.width_of(np.array([height]))[0])
    if width > usual + _WIDTH_DEVIATIONS * body.width_spread:
        return [
            f"bodies are {width:.2f} m wide in the median, {usual:.2f} m were expected: is the foreground too wide? "
            "[body] in the rig has the sizes to expect"
        ]
    return []


def _torn(cameras: Sequence[str], rates: Rows) -> list[str]:
    warnings = []
    for view, name in enumerate(cameras):
        miss = rates["miss"][rates["view"] == view]
        if len(miss) and (share := float(np.median(miss))) > _TORN_MISS_RATE:
            words = f"view {name} misses {100 * share:.0f} % of people's bodies"
            warnings.append(f"{words}: is its foreground torn, are boxes missing, or is its stream late (offset)?")
    return warnings
