"""Probability that a body fills a cell, calibrated on a run by its own tracks.

Log-odds of cells are evidence: views that share an error count as several, and beside a person half of the cells are
taken for filled beforehand. So of the cells said to be filled with 0.8, fewer are. Tracks are known far better than
cells: the share of cells of some log-odds that their pillars fill, made monotone by isotonic regression, is the
probability (Zadrozny and Elkan, Transforming classifier scores into accurate multiclass probability estimates, KDD
2002).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Flags, Floats, Rows, Singles, ground_of
from stseg.bodies.pillars import inside_bodies
from stseg.geometry.grid import Grid
from stseg.geometry.nearest_person import nearest_person

PERSON_RADIUS = 1.0
"""Metres around a person within which cells count, whatever their log-odds."""
CERTAIN_LOG_ODDS = 6.0
"""Cells farther away count where their log-odds are nearer to 0, nats."""
LOG_ODDS_KNOTS = np.linspace(-12.0, 12.0, 49)
"""Log-odds at which the probability is learned, nats."""


@dataclass(frozen=True)
class CellCounts:
    """Cells that were looked at and those that bodies fill, by the knot nearest to their log-odds."""

    cells: Floats
    """float64 (knot,): those that were looked at."""
    filled: Floats
    """float64 (knot,): those that bodies fill."""


def count_cells(log_odds: Singles, filled: Flags, counted: Flags) -> CellCounts:
    """Counts of one frame; all arrays are (plane, y, x), log-odds in nats."""
    knot = np.rint((log_odds[counted].astype(float) - LOG_ODDS_KNOTS[0]) / (LOG_ODDS_KNOTS[1] - LOG_ODDS_KNOTS[0]))
    knot = np.clip(knot, 0, len(LOG_ODDS_KNOTS) - 1).astype(np.int64)
    number = len(LOG_ODDS_KNOTS)
    cells, inside = np.bincount(knot, minlength=number), np.bincount(knot, filled[counted], number)
    return CellCounts(cells.astype(float), inside.astype(float))


def doubtful_cells(grid: Grid, log_odds: Singles, rows: Rows) -> Flags:
    """Cells that are seen, and in doubt or near a row of the frame, bool (plane, y, x)."""
    near_person = nearest_person(grid.ground, ground_of(rows), PERSON_RADIUS) >= 0
    return np.asarray(np.isfinite(log_odds) & ((np.abs(log_odds) < CERTAIN_LOG_ODDS) | near_person))


def filled_cells(grid: Grid, rows: Rows) -> Flags:
    """Cells that a pillar fills, bool (plane, y, x); `rows` have x, y and height in metres."""
    filled = np.zeros(grid.shape, bool)
    for x, y, height in zip(rows["x"], rows["y"], rows["height"], strict=True):
        ground = np.array([[x, y]], float)
        person = nearest_person(grid.ground, ground, PERSON_RADIUS)
        filled |= inside_bodies(grid, person, ground, np.array([height], float))
    return filled


@dataclass(frozen=True)
class CellReliability:
    """The calibration curve of a run."""

    probability: Floats
    """float64 (knot,): probability that a body fills a cell, at log-odds `LOG_ODDS_KNOTS`; never falls."""

    @classmethod
    def of(cls, counts: Iterable[CellCounts]) -> CellReliability:
        """The curve that fits counts of several frames; a half everywhere where no cell was counted."""
        frames = list(counts)
        cells = np.sum([frame.cells for frame in frames], 0) if frames else np.zeros(len(LOG_ODDS_KNOTS))
        filled = np.sum([frame.filled for frame in frames], 0) if frames else np.zeros(len(LOG_ODDS_KNOTS))
        counted = cells > 0
        if not counted.any():
            return cls(np.full(len(LOG_ODDS_KNOTS), 0.5))
        from scipy.optimize import isotonic_regression  # a run is read far more often than its cells' probability

        share = isotonic_regression(filled[counted] / cells[counted], weights=cells[counted]).x
        return cls(np.interp(LOG_ODDS_KNOTS, LOG_ODDS_KNOTS[counted], share))

    def of_cells(self, log_odds: Singles) -> Singles:
        """Probability of cells of any shape, float32, NaN where no view sees the cell."""
        return np.interp(log_odds, LOG_ODDS_KNOTS, self.probability).astype(np.float32)
