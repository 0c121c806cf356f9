"""Where a run goes wrong: its worst frames, and pictures of the ground at those."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stseg.arrays import Ints, Rows
from stseg.evaluation import evaluate
from stseg.io.outputs.output_files import write_file
from stseg.io.runfile.runs import Run
from stseg.reporting.page.html import png_bytes
from stseg.reporting.pictures.plan import plan_view

_SHOWN = 3
_APART = 5  # frames
_TRAIL = 1.5  # seconds


def frame_errors(trajectory: Rows, truth: Rows, frames: Sequence[int], scores: Mapping[str, Any], flags: bool) -> Ints:
    """Misses and false alarms of each frame, judged as the whole was.

    Parameters
    ----------
    trajectory, truth
    frames
        The frames to judge.
    scores
        Of the whole, for gate and area.
    flags
        Whether flagged rows are left out.

    Returns
    -------
    int64 (frame, 3)
        Frame, misses, false alarms.
    """
    area = None if scores["area"] is None else tuple(scores["area"])
    errors = []
    for frame in frames:
        own = truth[truth["frame"] == frame], trajectory[trajectory["frame"] == frame]
        judged = evaluate(*own, scores["gate_m"], area, np.array([frame]), flags)
        errors.append((frame, judged.misses, judged.false_alarms))
    return np.array(errors, np.int64).reshape(-1, 3)


def worst_frames(run: Run, truth: Rows, scores: Mapping[str, Any], flags: bool) -> list[int]:
    """The frames with most misses and false alarms, a few frames apart, in order of time."""
    frames = sorted(set(run.frames.tolist()) & set(truth["frame"].tolist()))
    errors = frame_errors(run.trajectory, truth, frames, scores, flags)
    chosen: list[int] = []
    for frame, *_ in errors[np.argsort(-errors[:, 1:].sum(axis=1), kind="stable")].tolist():
        if len(chosen) < _SHOWN and all(abs(frame - other) >= _APART for other in chosen):
            chosen.append(frame)
    return sorted(chosen)


def draw(run: Run, truth: Rows, frames: Sequence[int], folder: Path) -> None:
    """Write plan_FRAME.png: tracks and truth of the last moments, ending where people stand."""
    for frame in frames:
        first = frame - round(_TRAIL * run.frame_rate)
        picture = plan_view(
            run.recording.rig,
            _between(run.trajectory, first, frame),
            _between(truth, first, frame),
            run.views.max(axis=0),
            f"{run.scene}, frames {first} to {frame}",
        )
        write_file(folder / f"plan_{frame}.png", png_bytes(picture), True)


def _between(rows: Rows, first: int, last: int) -> Rows:
    return rows[(rows["frame"] >= first) & (rows["frame"] <= last)]
