"""What the tables and the figure of docs/occupancy.md rest on."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np

from stseg.geometry import Grid
from stseg.occupancy.fusion import Rates

ROOT = Path(__file__).parents[1]
sys.path.append(str(ROOT / "tools"))

import instances_figure  # noqa: E402
import occupancy_figures  # noqa: E402


def test_the_figure_shown_is_what_the_command_draws() -> None:
    shown, drawn = (ROOT / "docs" / "figures" / "instances.svg").read_text("utf-8"), instances_figure.figure()
    number = r"-?\d+\.\d+"
    assert re.sub(number, "", shown) == re.sub(number, "", drawn)
    before, now = (np.array(re.findall(number, page), float) for page in (shown, drawn))
    np.testing.assert_allclose(now, before, atol=0.2)


def test_places_are_peaks_one_after_the_other() -> None:
    grid = Grid((-2.0, 2.0), (-2.0, 2.0), 0.1)
    standing = np.array([[0.5, 0.5], [-0.8, 0.1]])
    away = np.hypot(*np.moveaxis(grid.ground[:, :, None] - standing, -1, 0))
    ground = (np.array([5.0, 4.0]) - 10 * away).max(-1)
    volume = np.broadcast_to(ground, grid.shape).astype(np.float32)
    np.testing.assert_allclose(occupancy_figures.places(volume, grid, 2), standing, atol=0.06)


def test_masks_are_spoiled_at_the_rates() -> None:
    mask = np.zeros((400, 400), np.float32)
    mask[:, 200:] = 1.0
    seen = occupancy_figures.spoiled(mask, Rates(0.3, 0.1, 0.1), (1, 2))
    assert set(np.unique(seen)) == {0.0, 1.0}
    assert abs(seen[:, :200].mean() - 0.1) < 0.03
    assert abs(seen[:, 200:].mean() - 0.7) < 0.05
