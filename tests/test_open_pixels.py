"""Means over a lattice's pillars: the same with strips of nothing but background left out, and by definition."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import BODY, FEW_HEIGHTS, corner_cameras, rig_of

from stseg.arrays import Floats
from stseg.detection.detector import Detector
from stseg.detection.open_pixels import OpenPixels, add_means, strip_boxes
from stseg.detection.views import PixelView

BACKGROUND = np.float32(-2.2)
DETECTOR = Detector(rig_of(corner_cameras(), cell=0.5, planes=3), ["pixels"] * 4, FEW_HEIGHTS, BODY)
CELLS = DETECTOR.lattice_ground[..., 0].size


def by_definition(view: PixelView, raster: Floats, heights: list[int]) -> Floats:
    """Mean log-odds of the open pixels over each outline, those outside the raster included."""
    outlines, mean = view.lattice, np.zeros((3, CELLS))
    for height in heights:
        for cell in range(CELLS):
            i = height * CELLS + cell
            spans = outlines.spans[outlines.start[i] : outlines.start[i + 1]]
            total = sum(raster[outlines.first[i] + k, a:b].sum() for k, (a, b) in enumerate(spans.tolist()))
            mean[height, cell] = total / outlines.area[i] if len(spans) else 0.0
    return mean


@pytest.mark.parametrize("view", DETECTOR.views)
def test_means_by_definition(view: PixelView) -> None:
    rng = np.random.default_rng(7)
    raster, free = np.full(view.shape, BACKGROUND), np.ones(view.shape, bool)
    row, column = view.shape[0] // 2, view.shape[1] // 2
    raster[row : row + 5, column : column + 3] = rng.normal(0, 2, (5, 3)).clip(-2, 2)
    free[row - 6 : row, column + 4 : column + 9] = False
    pixels, strips = OpenPixels.of(raster, free), strip_boxes(view.lattice, CELLS)
    score = np.zeros((3, CELLS))
    add_means(pixels, strips, view.lattice, np.array([0, 2]), np.arange(CELLS), 0.5, score)
    open_raster = np.where(free, raster, 0.0).astype(float)
    np.testing.assert_allclose(score, 0.5 * by_definition(view, open_raster, [0, 2]), atol=1e-9)


@pytest.mark.parametrize("view", DETECTOR.views[:1])
def test_strips_where_something_is_shown_are_summed(view: PixelView) -> None:
    """Each pixel inside some outline is noticed, whether it is foreground or somebody's."""
    strips, nothing = strip_boxes(view.lattice, CELLS), np.full(view.shape, BACKGROUND)
    every = np.arange(CELLS)
    for shown in (False, True):
        raster, free = nothing.copy(), np.ones(view.shape, bool)
        (raster if shown else free)[view.shape[0] // 2, view.shape[1] // 2] = 1 if shown else False
        said, silent = np.zeros((2, 3, CELLS))
        add_means(OpenPixels.of(raster, free), strips, view.lattice, np.arange(3), every, 1.0, said)
        add_means(OpenPixels.of(nothing, np.ones_like(free)), strips, view.lattice, np.arange(3), every, 1.0, silent)
        assert 0 < (said != silent).sum() < said.size / 2
        assert (said >= silent).all()
