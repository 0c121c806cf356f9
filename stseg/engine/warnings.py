"""What looks wrong in a run's views: silent ones, and those that see people beside where the others put them."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.calibration.knock_detection import find_knocks
from stseg.calibration.run_check import knocked, views_aside
from stseg.io.runfile.runs import Run
from stseg.report.findings import view_warnings

_MOVED = 1.0
"""Pixels by which a picture must move."""


def run_warnings(run: Run) -> list[str]:
    """A sentence for everything that a user should look at."""
    return view_warnings(run.cameras, run.ghosts, run.frames, run.frame_rate) + rig_warnings(run)


def rig_warnings(run: Run) -> list[str]:
    """The views whose pictures moved, and when; else the one that was knocked, or those that are off by over a cell."""
    frames, aside = _by_window(run)
    cell = run.recording.rig.grid.cell
    if moved := _moved(run):
        return moved
    if (knock := knocked(aside, cell)) is not None:
        name, before, after = run.cameras[knock.view], _beside(knock.before), _beside(knock.after)
        return [
            f"view {name} was moved about frame {frames[knock.frame]}: it sees people {after} where the views put "
            f"them, {before} it before"
        ]
    if off := views_aside(aside, cell):
        first, *others = (f"{run.cameras[one.view]} sees people {_beside(one.metres)}" for one in off)
        also = "".join(f", {other} it" for other in others)
        return [f"view {first} where the views put them{also}; see stseg calibrate check"]
    return []


def _moved(run: Run) -> list[str]:
    """A sentence for each colour view whose picture moved by a pixel or more."""
    frames, look = np.unique(run.shifts["frame"], return_inverse=True)
    shift = np.full((len(frames), len(run.cameras)), np.nan)
    shift[look, run.shifts["view"]] = np.hypot(run.shifts["u"], run.shifts["v"])
    return [
        f"view {run.cameras[knock.view]} was moved about frame {frames[knock.frame]}: its picture by "
        f"{knock.before - knock.after:.0f} pixels"
        for knock in find_knocks(-shift, _MOVED)
    ]


def _by_window(run: Run) -> tuple[Ints, Floats]:
    """The last frame of each window, and how far each view is aside in it (window, view), metres."""
    frames, window = np.unique(run.rates["frame"], return_inverse=True)
    aside = np.full((len(frames), len(run.cameras)), np.nan)
    aside[window, run.rates["view"]] = run.rates["aside"]
    return frames, aside


def _beside(metres: float) -> str:
    return f"{100 * abs(metres):.0f} cm to the {'right' if metres > 0 else 'left'} of"
