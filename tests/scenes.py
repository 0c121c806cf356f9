"""Named micro-scenes: four cameras around four by four metres, people at given places, what each camera shows of them.

Everything is drawn from projections of points in space, with nothing of the tables that the stages use. People are
rows of x, y and height in metres, float64 (n, 3).
"""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import ArrayLike
from reference_core import best_pairs

from stseg import Boxes, Camera, Config, FrameSet, Grid, Lens, Rig
from stseg.arrays import Bytes, Floats, Observation, Rows, Singles, ViewEvidence
from stseg.bodies.pillars import PROFILE, SILHOUETTE
from stseg.config import BodyConfig, DetectionConfig
from stseg.detection.detector import Detector
from stseg.records.people import People
from stseg.records.predicted_tracks import PredictedTracks, no_tracks
from stseg.records.sizes import Sizes
from stseg.records.tables import TRAJECTORY

SIZE = (128, 96)
FOCAL = 75.0
AREA = (-2.0, 2.0)
FRAME_RATE = 8.0
FEW_HEIGHTS = DetectionConfig(lattice_spacing=0.25)
BODY = BodyConfig(heights=(1.6, 1.7, 1.8))
"""The pass with few heights and a coarse lattice: as good on these scenes, and quick without a compiler."""
CONFIG = Config(body=BODY, detection=FEW_HEIGHTS)
_FINE = 4
_BITS = 6


def rotation_towards(centre: ArrayLike, target: ArrayLike) -> Floats:
    """Rotation of an upright camera at a place that looks at another, rows right, down and forward."""
    forward = np.subtract(target, centre, dtype=float)
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(forward, right), forward])


def looking(
    name: str,
    centre: Sequence[float],
    target: Sequence[float] = (0.0, 0.0, 0.9),
    size: tuple[int, int] = SIZE,
    focal: float = FOCAL,
    distortion: Sequence[float] | None = None,
) -> Camera:
    """A camera at a place, metres, that looks at another."""
    rotation = rotation_towards(centre, target)
    matrix = np.array([[focal, 0.0, (size[0] - 1) / 2], [0.0, focal, (size[1] - 1) / 2], [0.0, 0.0, 1.0]])
    projection = matrix @ np.column_stack([rotation, -rotation @ centre])
    lens = None if distortion is None else Lens(matrix, np.asarray(distortion, float))
    return Camera.from_projection(name, size, projection, lens)


def corner_cameras() -> tuple[Camera, ...]:
    """One camera above each corner of the room."""
    corners = ((-3.5, -3.5), (3.5, -3.4), (3.4, 3.5), (-3.4, 3.4))
    return tuple(looking(f"corner{k}", (*corner, 2.6)) for k, corner in enumerate(corners))


def rig_of(cameras: Sequence[Camera], cell: float = 0.25, planes: int = 4) -> Rig:
    """The room under these cameras."""
    return Rig("room", FRAME_RATE, Grid(AREA, AREA, cell, 1.8, planes), tuple(cameras))


def room() -> Rig:
    """The room under its four corner cameras."""
    return rig_of(corner_cameras())


def people(*places: Sequence[float]) -> Floats:
    """People at x, y (metres) and, where it is given, of a height; 1.7 m otherwise."""
    return np.array([(*place, 1.7)[:3] if len(place) == 2 else place for place in places], float).reshape(-1, 3)


def expecting(*places: Sequence[float]) -> PredictedTracks:
    """People seen in the frame before, who are expected at places of x, y (metres) and, where given, of a height."""
    standing, n = people(*places), len(places)
    covariance = np.tile(np.eye(2) * 0.2**2, (n, 1, 1))
    return PredictedTracks(standing[:, :2], covariance, sizes_of(standing[:, 2], 0.05), np.ones(n))


def sizes_of(height: Floats, spread: float) -> Sizes:
    """Sizes of people so tall and of mean width, as sure as `spread`, metres."""
    variance, width = np.full(len(height), spread**2), np.full(len(height), CONFIG.body.width_mean)
    return Sizes(height, variance, width, variance)


def found(standing: Floats, expected: PredictedTracks | None = None, evidence: float = 6.0, views: int = 4) -> People:
    """People as the pass of a frame reports them: in place, wholly visible, and whom of those expected."""
    n, before = len(standing), expected or no_tracks()
    known = (
        before.track_log_ratio(standing[:, :2], standing[:, 2], CONFIG.body, CONFIG.detection.prior_log_odds)
        + CONFIG.detection.birth_cost
    )
    walker, covariance = np.full(n, -1), np.tile(np.eye(2) * 0.01, (n, 1, 1))
    for j, k in best_pairs(known):
        walker[j] = k
        covariance[j] = np.linalg.inv(np.linalg.inv(covariance[j]) + np.linalg.inv(before.covariance[k]))
    ones, nats = np.ones((views, n)), np.full(n, evidence)
    sizes = sizes_of(standing[:, 2], 1e-3)
    return People(standing[:, :2], sizes.height, sizes.width, covariance, nats, ones, ones, np.zeros(n), walker, sizes)


def ring(person: Floats, share: float, radius: float, points: int = 32) -> Floats:
    """Points of one disc of a body, at a share of its height, float64 (points, 3), metres."""
    angle = np.linspace(0, 2 * np.pi, points, endpoint=False)
    x, y, height = person
    return np.column_stack([x + radius * np.cos(angle), y + radius * np.sin(angle), np.full(points, share * height)])


def body_points(person: Floats, levels: int = 60) -> Floats:
    """Points of the whole body of revolution, float64 (n, 3), metres."""
    shares = np.union1d(np.linspace(0, 1, levels), PROFILE[:, 0])
    return np.concatenate([ring(person, s, float(np.interp(s, PROFILE[:, 0], PROFILE[:, 1]))) for s in shares])


def body_box(camera: Camera, person: Floats) -> Floats:
    """Left, top, right, bottom of a body's pixels, not clipped to the image; nan where a point of it is unseen."""
    points = body_points(person)
    pixel, ahead = camera.project(points[:, :2], points[:, 2])
    return np.concatenate([pixel.min(0), pixel.max(0)]) if ahead.all() else np.full(4, np.nan)


def box(camera: Camera, person: Floats) -> Boxes:
    """A perfect detector's box of one person, clipped to the image; none where the person is outside it."""
    width, height = camera.size
    edges = body_box(camera, person).clip(0, [width - 1, height - 1] * 2)
    if not (edges[2] > edges[0] and edges[3] > edges[1]):
        return no_boxes()
    return Boxes(np.concatenate([edges[:2], edges[2:] - edges[:2]])[None], np.ones(1))


def no_boxes() -> Boxes:
    """A frame in which a detector found nobody."""
    return Boxes(np.zeros((0, 4)), np.zeros(0))


def together(found: Sequence[Boxes]) -> Boxes:
    """All boxes of one view."""
    return Boxes(
        np.concatenate([np.zeros((0, 4)), *(b.pixel for b in found)]), np.concatenate([[], *(b.score for b in found)])
    )


def boxes(camera: Camera, standing: Floats) -> Boxes:
    """A perfect detector's boxes of everybody, hidden or not."""
    return together([box(camera, person) for person in standing])


def mask(camera: Camera, standing: Floats) -> Bytes:
    """The exact silhouette of everybody, uint8 (v, u); pixels at its edge are as bright as they are covered."""
    width, height = camera.size
    fine = np.zeros((height * _FINE, width * _FINE), np.uint8)
    for person in standing:
        for lower, upper in pairwise(SILHOUETTE):
            points = np.concatenate([ring(person, *lower), ring(person, *upper)])
            pixel, ahead = camera.project(points[:, :2], points[:, 2])
            if ahead.all():
                corners = np.rint(((pixel + 0.5) * _FINE - 0.5) * 2**_BITS).astype(np.int32)
                cv2.fillConvexPoly(fine, cv2.convexHull(corners), (255,), shift=_BITS)
    cells = fine.reshape(height, _FINE, width, _FINE).astype(float)
    return np.asarray(np.rint(cells.mean((1, 3))), np.uint8)


def likelihoods(cameras: Sequence[Camera], standing: Floats) -> list[Singles]:
    """The masks of all cameras as likelihood maps, float32 (v, u)."""
    return [(mask(camera, standing) / np.float32(255)).astype(np.float32) for camera in cameras]


def evidence_of(kind: str, cameras: Sequence[Camera], standing: Floats) -> list[ViewEvidence]:
    """Exact silhouettes for "pixels", else a box of each person."""
    return list(likelihoods(cameras, standing)) if kind == "pixels" else [boxes(one, standing) for one in cameras]


def detector_of(rig: Rig, kind: str) -> Detector:
    """The pass with few heights, of views of one kind."""
    return Detector(rig, [kind] * len(rig.cameras), FEW_HEIGHTS, BODY)


def three_people(share: Floats) -> Floats:
    """x, y, height, metres, of three people who have gone shares (n,) of their ways, float64 (n, 3, 3).

    The first two pass each other 0.9 m apart, the third walks a half circle.
    """
    turn, one = np.pi * share, np.ones(len(share))
    x = [-1.4 + 2.8 * share, 1.4 - 2.8 * share, 1.3 * np.cos(turn) + 0.1]
    y = [-1.3 * one, -0.4 * one, 0.4 + 1.1 * np.sin(turn)]
    return np.stack([x, y, [1.7 * one, 1.8 * one, 1.6 * one]]).T


def walkers(frames: int) -> Rows:
    """They walk through the room for so many frames; TRAJECTORY rows with frame, id, x, y, height."""
    rows = np.zeros((frames, 3), TRAJECTORY)
    rows["frame"], rows["id"] = np.arange(frames)[:, None], [11, 12, 13]
    rows["x"], rows["y"], rows["height"] = np.moveaxis(three_people(np.arange(frames) / 40), 2, 0)
    return rows.ravel()


def standing_at(truth: Rows, frame: int) -> Floats:
    """People of one frame of a trajectory."""
    own = truth[truth["frame"] == frame]
    return np.column_stack([own["x"], own["y"], own["height"].astype(float)])


def _frame_sets(
    shown: Callable[[Camera, Floats], Observation], rig: Rig, truth: Rows, first: int, stop: int
) -> Iterator[FrameSet]:
    for frame in range(first, stop):
        standing = standing_at(truth, frame)
        yield FrameSet(frame, tuple(shown(camera, standing) for camera in rig.cameras))


mask_frame_sets, box_frame_sets = partial(_frame_sets, mask), partial(_frame_sets, boxes)
"""Frames first .. stop - 1 as masks, and as boxes, of all cameras."""
