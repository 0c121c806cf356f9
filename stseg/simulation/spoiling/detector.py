"""Model of a person detector: missed, inexact and false boxes."""

import numpy as np

from stseg.arrays import Boxes, Floats, Ints
from stseg.geometry import Camera
from stseg.geometry.rig import BODY_HEIGHT
from stseg.kernels.accelerate import kernel

_MIN_AREA = 0.0015  # least visible area of a detection, share of the image
_MAX_PROBABILITY = 0.97  # of detection, in full view
_HALF_SHARE, _SHARE_WIDTH = 0.35, 0.09  # visible share at half of that probability, and width of the transition
_WHOLE_BODY_PROBABILITY = 0.6  # probability that the box of a partly hidden person spans the whole body
_EDGE_SPREAD = 0.03  # standard deviation of each edge, share of the box's width and height
_FALSE_RATE = 0.08  # false boxes a view and frame
_MAX_OVERLAP = 0.65  # intersection over union above which the lower score is suppressed


@kernel
def visible_boxes(instances: np.ndarray[tuple[int, int], np.dtype[np.uint16]], row_of: Ints, visible: Ints) -> None:
    """Bounding boxes and pixel counts of each visible person.

    Parameters
    ----------
    instances : uint16 (v, u)
        Id of the person that each pixel shows, 0 for background.
    row_of : int64 (id,)
        Row of `visible` for each id.
    visible : int64 (n, 5)
        Filled with first and last column, first and last row, and number.
    """
    rows, columns = instances.shape
    for row in range(len(visible)):
        extent = visible[row]
        extent[0], extent[1], extent[2], extent[3], extent[4] = columns, -1, rows, -1, 0
    for v in range(rows):
        for u in range(columns):
            if instances[v, u] > 0:
                extent = visible[row_of[instances[v, u]]]
                extent[0], extent[1] = min(extent[0], u), max(extent[1], u)
                extent[2], extent[3] = min(extent[2], v), max(extent[3], v)
                extent[4] += 1


def detect(camera: Camera, visible: Ints, silhouettes: Ints, half: Floats, rng: np.random.Generator) -> Boxes:
    """Simulate a detector's boxes for one view and frame.

    Parameters
    ----------
    camera
        The view.
    visible, silhouettes : int64 (n, 5)
        First and last column, first and last row, and pixel count of each person, as visible and without occlusion.
    half : float64 (2,)
        Half the area's sides, metres: false boxes have the size of people in it.
    rng
        Source of randomness.
    """
    width, height = camera.size
    share = visible[:, 4] / np.maximum(silhouettes[:, 4], 1)
    probability = _MAX_PROBABILITY / (1 + np.exp((_HALF_SHARE - share) / _SHARE_WIDTH))
    found = (rng.uniform(size=len(share)) < probability) & (visible[:, 4] > _MIN_AREA * width * height)
    guessed = (rng.uniform(size=len(share)) < _WHOLE_BODY_PROBABILITY) & (share > _HALF_SHARE)
    spans = np.where(guessed[:, None], silhouettes, visible)[:, :4]
    # left, top, right, bottom, with errors
    edges = spans[:, [0, 2, 1, 3]] + np.array([-0.5, -0.5, 0.5, 0.5])
    size = np.maximum(spans[:, [1, 3]] - spans[:, [0, 2]] + 1, 1)
    edges = edges + rng.normal(0.0, _EDGE_SPREAD, (len(spans), 4)) * np.tile(size, 2)
    score = np.clip(0.35 + 0.6 * share + rng.normal(0.0, 0.08, len(share)), 0.05, 1.0)
    false_edges, false_scores = _false_boxes(camera, half, rng)
    edges, score = np.concatenate([edges[found], false_edges]), np.concatenate([score[found], false_scores])
    edges = np.clip(edges, -0.5, [width - 0.5, height - 0.5, width - 0.5, height - 0.5])
    kept = _non_maximum_suppression(edges, score)
    return Boxes(np.concatenate([edges[kept, :2], edges[kept, 2:] - edges[kept, :2]], axis=1), score[kept])


def _false_boxes(camera: Camera, half: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """False boxes (n, 4) of a person's size at random ground points, and their scores."""
    count = int(rng.poisson(_FALSE_RATE))
    ground = rng.uniform(-1.0, 1.0, (count, 2)) * half
    foot, ahead = camera.project(ground, 0.0)
    head, above = camera.project(ground, BODY_HEIGHT)
    wide = 0.4 * np.abs(foot[:, 1] - head[:, 1]) / 2
    edges = np.stack([foot[:, 0] - wide, head[:, 1], foot[:, 0] + wide, foot[:, 1]], axis=1)
    visible = ahead & above & camera.inside((foot + head) / 2) & (wide > 1)
    return edges[visible], rng.uniform(0.2, 0.6, count)[visible]


def _non_maximum_suppression(edges: Floats, score: Floats) -> Ints:
    """Rows kept by greedy non-maximum suppression, in order of falling score."""
    kept: list[int] = []
    for row in np.argsort(-score, kind="stable").tolist():
        low, high = np.maximum(edges[row, :2], edges[kept, :2]), np.minimum(edges[row, 2:], edges[kept, 2:])
        common = np.prod(np.maximum(high - low, 0.0), axis=1)
        union = _areas(edges[[row]]) + _areas(edges[kept]) - common
        if (common <= _MAX_OVERLAP * union).all():
            kept.append(row)
    return np.array(sorted(kept), np.int64)


def _areas(edges: Floats) -> Floats:
    return np.asarray(np.prod(np.maximum(edges[:, 2:] - edges[:, :2], 1e-9), axis=1))
