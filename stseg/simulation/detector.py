"""What a detector of people would say of a view: boxes that are missing, shaky, or of nobody."""

from __future__ import annotations

import numpy as np

from stseg.accelerate import kernel
from stseg.arrays import Boxes, Floats, Ints
from stseg.geometry import Camera

_SMALLEST = 0.0015  # of the image's area: who covers less is not found
_BEST, _HALF, _SOFT = 0.97, 0.35, 0.09  # chance to find who is in full view; share in view at which half are found
_GUESS = 0.6  # chance that of one half hidden the whole body is guessed, when enough of it shows
_JITTER = 0.03  # of the box's width and height, standard deviation of each edge
_FALSE = 0.08  # boxes of nobody a view and frame
_OVERLAP = 0.65  # intersection over union of two boxes of which a detector keeps the better


@kernel
def visible_boxes(instances: np.ndarray[tuple[int, int], np.dtype[np.uint16]], row_of: Ints, visible: Ints) -> None:
    """Boxes and numbers of the pixels that show each person.

    Parameters
    ----------
    instances : uint16 (v, u)
        Whom each pixel shows, 0 for nobody.
    row_of : int64 (id,)
        Each person's row of `visible`.
    visible : int64 (n, 5)
        Filled with first and last column, first and last row, and number.
    """
    rows, columns = instances.shape
    for row in range(len(visible)):
        seen = visible[row]
        seen[0], seen[1], seen[2], seen[3], seen[4] = columns, -1, rows, -1, 0
    for v in range(rows):
        for u in range(columns):
            if instances[v, u] > 0:
                seen = visible[row_of[instances[v, u]]]
                seen[0], seen[1] = min(seen[0], u), max(seen[1], u)
                seen[2], seen[3] = min(seen[2], v), max(seen[3], v)
                seen[4] += 1


def detect(camera: Camera, visible: Ints, silhouettes: Ints, half: Floats, lots: np.random.Generator) -> Boxes:
    """Boxes as a detector gives them.

    Parameters
    ----------
    camera
        The view.
    visible, silhouettes : int64 (n, 5)
        First and last column, first and last row, and number of the pixels that show each person, and of those that
        would if it stood there alone.
    half : float64 (2,)
        Half the area's sides, metres: false boxes look like people who stand in it.
    lots
        Where chance comes from.
    """
    width, height = camera.size
    share = visible[:, 4] / np.maximum(silhouettes[:, 4], 1)
    chance = _BEST / (1 + np.exp((_HALF - share) / _SOFT))
    found = (lots.uniform(size=len(share)) < chance) & (visible[:, 4] > _SMALLEST * width * height)
    guessed = (lots.uniform(size=len(share)) < _GUESS) & (share > _HALF)
    spans = np.where(guessed[:, None], silhouettes, visible)[:, :4]
    edges = _edges(spans) + _shake(spans, lots)
    score = np.clip(0.35 + 0.6 * share + lots.normal(0.0, 0.08, len(share)), 0.05, 1.0)
    nobody, belief = _of_nobody(camera, half, lots)
    edges, score = np.concatenate([edges[found], nobody]), np.concatenate([score[found], belief])
    edges = np.clip(edges, -0.5, [width - 0.5, height - 0.5, width - 0.5, height - 0.5])
    kept = _keep(edges, score)
    return Boxes(np.concatenate([edges[kept, :2], edges[kept, 2:] - edges[kept, :2]], axis=1), score[kept])


def _edges(spans: Ints) -> Floats:
    """left, top, right, bottom of spans of pixels (first column, last column, first row, last row)."""
    return np.asarray(spans[:, [0, 2, 1, 3]] + np.array([-0.5, -0.5, 0.5, 0.5]))


def _shake(spans: Ints, lots: np.random.Generator) -> Floats:
    size = np.maximum(spans[:, [1, 3]] - spans[:, [0, 2]] + 1, 1)
    return np.asarray(lots.normal(0.0, _JITTER, (len(spans), 4)) * np.tile(size, 2))


def _of_nobody(camera: Camera, half: Floats, lots: np.random.Generator) -> tuple[Floats, Floats]:
    """Boxes (n, 4) where nobody stands, about as large as people are there, and their scores."""
    count = int(lots.poisson(_FALSE))
    ground = lots.uniform(-1.0, 1.0, (count, 2)) * half
    foot, ahead = camera.project(ground, 0.0)
    head, above = camera.project(ground, 1.7)
    wide = 0.4 * np.abs(foot[:, 1] - head[:, 1]) / 2
    edges = np.stack([foot[:, 0] - wide, head[:, 1], foot[:, 0] + wide, foot[:, 1]], axis=1)
    seen = ahead & above & camera.inside((foot + head) / 2) & (wide > 1)
    return edges[seen], lots.uniform(0.2, 0.6, count)[seen]


def _keep(edges: Floats, score: Floats) -> Ints:
    """Rows that survive the suppression of what is not the best (greedy, by falling score)."""
    kept: list[int] = []
    for row in np.argsort(-score, kind="stable").tolist():
        low, high = np.maximum(edges[row, :2], edges[kept, :2]), np.minimum(edges[row, 2:], edges[kept, 2:])
        common = np.prod(np.maximum(high - low, 0.0), axis=1)
        union = _areas(edges[[row]]) + _areas(edges[kept]) - common
        if (common <= _OVERLAP * union).all():
            kept.append(row)
    return np.array(sorted(kept), np.int64)


def _areas(edges: Floats) -> Floats:
    return np.asarray(np.prod(np.maximum(edges[:, 2:] - edges[:, :2], 1e-9), axis=1))
