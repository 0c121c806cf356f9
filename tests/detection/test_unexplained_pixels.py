"""Evidence of unexplained pixels for a lattice's pillars: by definition, or none where it is too little to matter."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import BODY, FEW_HEIGHTS, corner_cameras, rig_of

from stseg.arrays import Floats, Shorts, Singles
from stseg.detection.detector import Detector
from stseg.detection.evidence.pillar_evidence import fill_scores
from stseg.detection.evidence.unexplained_pixels import UnexplainedPixels

BACKGROUND = np.float32(-2.2)
DETECTOR = Detector(rig_of(corner_cameras(), cell=0.5, planes=3), ["pixels"] * 4, FEW_HEIGHTS, BODY)
LATTICE = DETECTOR.pixel_lattice
CELLS = DETECTOR.lattice_ground[..., 0].size
WEIGHT, SCORE_BEFORE = 0.5, 4.2


def nothing() -> Singles:
    return np.full((4, *LATTICE.shapes.max(0)), BACKGROUND)


def scene(seed: int) -> tuple[Singles, Shorts]:
    """Log-odds of background with some foreground in it, and a member who explains pixels next to it."""
    rng = np.random.default_rng(seed)
    rasters, owner = nothing(), np.full((4, *LATTICE.shapes.max(0)), -1, np.int16)
    row, column = rasters.shape[1] // 2, rasters.shape[2] // 2
    rasters[:, row : row + 9, column : column + 5] = rng.normal(1, 1, (4, 9, 5)).clip(-2, 2)
    owner[:, row - 6 : row, column + 4 : column + 9] = 0
    parts = [pillar[: shape[0], : shape[1]].reshape(-1) for pillar, shape in zip(owner, LATTICE.shapes, strict=True)]
    return rasters, np.concatenate(parts)


def by_definition(rasters: Singles, owner: Shorts) -> Floats:
    """Sums over all views of the mean log-odds of open pixels over each outline, (height, cell)."""
    outlines, mean, start = LATTICE.outlines, np.zeros((4, 3 * CELLS)), 0
    for view, (rows, columns) in enumerate(LATTICE.shapes.tolist()):
        own_view = owner[start : start + rows * columns].reshape(rows, columns)
        is_shown = np.where(own_view < 0, rasters[view, :rows, :columns], 0.0).astype(float)
        start += rows * columns
        for pillar in range(3 * CELLS):
            i = view * 3 * CELLS + pillar
            spans = outlines.spans[outlines.start[i] : outlines.start[i + 1]]
            total = sum(is_shown[outlines.first[i] + k, a:b].sum() for k, (a, b) in enumerate(spans.tolist()))
            mean[view, pillar] = total / outlines.area[i] if len(spans) else 0.0
    return np.asarray(SCORE_BEFORE + WEIGHT * mean.sum(0).reshape(CELLS, 3).T)


def scores(rasters: Singles, owner: Shorts, minimum_probe_score: float) -> Floats:
    extremes = np.tile([rasters.min(), rasters.max()], (4, 1)).astype(float)
    score = np.full((3, CELLS), SCORE_BEFORE)
    pixels = UnexplainedPixels.of(rasters, owner, LATTICE, extremes)
    fill_scores(pixels, LATTICE, np.array([1]), np.array([0, 2]), minimum_probe_score, WEIGHT, score)
    return score


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("minimum_probe_score", [-np.inf, -1.0])
def test_scores_by_definition_where_they_matter(seed: int, minimum_probe_score: float) -> None:
    found, expected = scores(*scene(seed), minimum_probe_score), by_definition(*scene(seed))
    is_evaluated = np.isfinite(found)
    np.testing.assert_allclose(found[is_evaluated], expected[is_evaluated], atol=1e-9)
    worth = expected[1] > minimum_probe_score
    assert is_evaluated[1, worth].all()
    assert is_evaluated[:, worth][expected[:, worth] > 0].all()
    assert not is_evaluated[::2, ~worth].any()
    assert (expected > 0).any()


def test_whatever_is_shown_is_noticed() -> None:
    """Each pixel inside some outline counts, whether it is foreground or a member's."""
    no_owner = np.full(int(LATTICE.shapes.prod(1).sum()), -1, np.int16)
    silent = scores(nothing(), no_owner, -np.inf)[1]
    row, column = LATTICE.shapes[0] // 2
    bright, explained = nothing(), no_owner.copy()
    bright[0, row, column] = 1
    explained[row * LATTICE.shapes[0, 1] + column] = 0
    for score in (scores(bright, no_owner, -np.inf)[1], scores(nothing(), explained, -np.inf)[1]):
        assert 0 < (score != silent).sum() < score.size / 2
        assert (score >= silent).all()
