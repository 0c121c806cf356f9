"""Probability of the cells of a run file, calibrated by its tracks."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stseg.records.cell_reliability import CellCounts, CellReliability, count_cells, doubtful_cells, filled_cells

if TYPE_CHECKING:
    from stseg.arrays import Rows
    from stseg.geometry import Grid
    from stseg.io.runfile.reading.run_reader import Run

_FRAMES = 48
"""Frames that the curve is learned from, spread over the run: they hold some 10^5 cells in doubt."""


def learn_reliability(run: Run) -> CellReliability:
    """The curve of a run, from frames spread over it; raises FormatError as reading does."""
    chosen = np.unique(np.linspace(0, len(run.frames), _FRAMES, endpoint=False).astype(int))
    grid, rows = run.recording.rig.grid, run.trajectory
    return CellReliability.of(_counts(run, grid, rows, frame) for frame in run.frames[chosen[chosen < len(run.frames)]])


def _counts(run: Run, grid: Grid, rows: Rows, frame: int) -> CellCounts:
    log_odds, _ = run.read_frame(int(frame))
    frame_rows = rows[rows["frame"] == frame]
    return count_cells(log_odds, filled_cells(grid, frame_rows), doubtful_cells(grid, log_odds, frame_rows))
