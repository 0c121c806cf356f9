"""Errors of a segmentation: silhouettes too wide or too narrow, torn, cut off, missing, and foreground without people.

Each error takes the mask uint8 (v, u), 0..255; the person at each pixel (v, u), 0 for none; its strength
(`stseg.simulation.spoiling.spoil.STRENGTHS`); and the camera's moment.
"""

import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Boxes, Bytes
from stseg.simulation.scene import Topic, random_stream

People = NDArray[np.uint16]

_ABSENCE = 0.5
"""Time for which a person is missing, seconds."""
_ARRIVAL_TIME = 2.0
"""Time within which what stays has come, seconds."""
_HOLE_SIZE = 0.4
"""Size of holes, share of a body's width."""
_BLOB_RADIUS = (0.05, 0.2)
"""Least and greatest radius of small blobs, shares of a body's width."""
_OBJECT_HEIGHT = 3.0
"""Height of what stays, beside a body's width."""


@dataclass(frozen=True)
class Moment:
    """One camera's frame."""

    seed: int
    camera: int
    frame: int
    """Seed of the scene, number of the camera and of the frame."""
    frame_rate: float
    """Frames per second."""
    body_width: float
    """Width of a common body in the middle of the area, pixels."""

    def stream(self, kind: str) -> np.random.Generator:
        """Randomness of one kind of error in this frame."""
        return random_stream(self.seed, Topic.SPOIL, zlib.crc32(kind.encode()), self.camera, self.frame)

    def lasting(self, kind: str, *which: int) -> np.random.Generator:
        """Randomness of something that outlasts the frame."""
        return random_stream(self.seed, Topic.SPOIL, zlib.crc32(kind.encode()), self.camera, *which, 1)


class _Extent(NamedTuple):
    """Rows and columns that a person's pixels span, the last ones excluded."""

    person: int
    top: int
    bottom: int
    left: int
    right: int


def _extents(people: People) -> Iterator[_Extent]:
    for person in np.unique(people[people > 0]).tolist():
        v, u = np.nonzero(people == person)
        yield _Extent(person, int(v.min()), int(v.max()) + 1, int(u.min()), int(u.max()) + 1)


def _disc(share: float, moment: Moment) -> Bytes:
    radius = round(share * moment.body_width / 2)
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1)), np.uint8)


def _dilation(mask: Bytes, _people: People, share: float, moment: Moment) -> Bytes:
    return np.asarray(cv2.dilate(mask, _disc(share, moment)), np.uint8)


def _erosion(mask: Bytes, _people: People, share: float, moment: Moment) -> Bytes:
    return np.asarray(cv2.erode(mask, _disc(share, moment)), np.uint8)


def _holes(mask: Bytes, _people: People, share: float, moment: Moment) -> Bytes:
    """Smooth noise below a quantile tears the silhouettes, in each frame anew."""
    height, width = mask.shape
    grain = max(2, round(_HOLE_SIZE * moment.body_width))
    coarse = moment.stream("holes").random((height // grain + 2, width // grain + 2))
    noise = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
    inside = mask > 0
    level = np.quantile(noise[inside], share) if inside.any() else 0.0
    return np.where(noise < level, np.uint8(0), mask)


def _legs(mask: Bytes, people: People, share: float, _moment: Moment) -> Bytes:
    cut = mask.copy()
    for one in _extents(people):
        knee = one.bottom - round(share * (one.bottom - one.top))
        cut[knee:][people[knee:] == one.person] = 0
    return cut


def _shadows(mask: Bytes, people: People, share: float, moment: Moment) -> Bytes:
    """A flat ellipse beside each person's feet, to the same side in all frames of a view."""
    side, darkened = (-1, 1)[moment.camera % 2], mask.copy()
    for one in _extents(people):
        length = share * (one.bottom - one.top) / 2
        middle = (round((one.left + one.right) / 2 + side * length), one.bottom - 1)
        cv2.ellipse(darkened, middle, (round(length), max(1, round(length / 4))), 0, 0, 360, 255, -1)
    return darkened


def _flicker(mask: Bytes, people: People, share: float, moment: Moment) -> Bytes:
    blink, left = int(moment.frame / (moment.frame_rate * _ABSENCE)), mask.copy()
    for person in np.unique(people[people > 0]).tolist():
        if moment.lasting("flicker", person, blink).uniform() < share:
            left[people == person] = 0
    return left


def _staying(mask: Bytes, _people: People, number: float, moment: Moment) -> Bytes:
    height, width = mask.shape
    spoiled = mask.copy()
    for blob in range(round(number)):
        rng = moment.lasting("staying", blob)
        comes, left, top = rng.uniform(0, _ARRIVAL_TIME), rng.uniform(0, width), rng.uniform(height / 4, height)
        if moment.frame >= comes * moment.frame_rate:
            right, bottom = left + moment.body_width, top + _OBJECT_HEIGHT * moment.body_width
            spoiled[int(top) : int(bottom), int(left) : int(right)] = 255
    return spoiled


def _rain(mask: Bytes, _people: People, number: float, moment: Moment) -> Bytes:
    rng, spoiled = moment.stream("rain"), mask.copy()
    for _ in range(rng.poisson(number)):
        u, v = (int(rng.integers(side)) for side in mask.shape[::-1])
        cv2.circle(spoiled, (u, v), round(rng.uniform(*_BLOB_RADIUS) * moment.body_width), 255, -1)
    return spoiled


def _jpeg(mask: Bytes, _people: People, strength: float, _moment: Moment) -> Bytes:
    quality = max(1, round(100 * (1 - strength)))
    _, packed = cv2.imencode(".jpg", mask, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(cv2.imdecode(packed, cv2.IMREAD_GRAYSCALE), np.uint8)


MASK_KINDS: dict[str, Callable[[Bytes, People, float, Moment], Bytes]] = {
    "dilation": _dilation,
    "erosion": _erosion,
    "holes": _holes,
    "legs": _legs,
    "shadows": _shadows,
    "flicker": _flicker,
    "staying": _staying,
    "rain": _rain,
    "jpeg": _jpeg,
}


_DOUBLE_SPREAD = 0.25
"""Standard deviation of the edges of a box's double, share of its size."""


def _jitter(boxes: Boxes, share: float, rng: np.random.Generator) -> Boxes:
    """Edges moved by normal errors, shares of the box's size."""
    corner, size = boxes.pixel[:, :2], boxes.pixel[:, 2:]
    first = corner + rng.normal(0.0, share, corner.shape) * size
    last = corner + size + rng.normal(0.0, share, corner.shape) * size
    return Boxes(np.concatenate([first, np.maximum(last - first, 1.0)], 1), boxes.score)


def _missed(boxes: Boxes, share: float, rng: np.random.Generator) -> Boxes:
    kept = rng.uniform(size=len(boxes)) >= share
    return boxes.of(kept)


def _doubled(boxes: Boxes, share: float, rng: np.random.Generator) -> Boxes:
    """A share of the boxes with an inexact double of lower score."""
    chosen = rng.uniform(size=len(boxes)) < share
    twins = _jitter(Boxes(boxes.pixel[chosen], 0.8 * boxes.score[chosen]), _DOUBLE_SPREAD, rng)
    return Boxes(np.concatenate([boxes.pixel, twins.pixel]), np.concatenate([boxes.score, twins.score]))


BOX_KINDS: dict[str, Callable[[Boxes, float, np.random.Generator], Boxes]] = {
    "jitter": _jitter,
    "missed": _missed,
    "doubled": _doubled,
}
"""Each takes a view's boxes, a strength and a random stream."""
