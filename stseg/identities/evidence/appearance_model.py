"""Appearance as evidence of identity: how much features and colours tell is learned from the recording.

A row's appearance is the mean over the views that see its person apart, less each camera's offset (a gain, where the
numbers are logarithms of colours). It is whitened by its scatter within people and turned to the axes along which
people differ most: probabilistic linear discriminant analysis (Ioffe 2006). Each axis is then one more size of the
person (`stseg.identities.evidence.size_model`). It is learned twice: first from isolated tracklets, each a person of
its own, then from the identities that are found with it, for appearance outlasts tracklets. Where identities err, the
appearance of people seems to change, and weighs less.

How many frames make one independent observation is learned (`stseg.identities.evidence.appearance_axes`); it is no
less than differences within tracklets say. Where appearance is no better than chance, it says nothing and is left out.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Flags, Floats, Ints, Rows
from stseg.identities.evidence.appearance_axes import WRONG, Axes, discriminant_axes, independent_frames
from stseg.identities.evidence.size_model import SizeModel, measured_tracklets, prior_errors
from stseg.noise.lasting_error import constant_errors
from stseg.records.tables import APPEARANCE

_LEAST_FRAMES = 8
"""Least frames of half a person's time."""
_LEAST_PEOPLE, _MOST_PEOPLE = 3, 1000
"""Least and most people."""
_PEOPLE_BLOCK = 50
"""Successive people that are taken or left out together: tracklets are compared with people of the same time."""


@dataclass(frozen=True)
class LearnedAppearance:
    """Appearance along a few axes."""

    value: Floats
    """float64 (n, axis): of each row, nan where unknown."""
    model: SizeModel
    """Statistics of each axis."""
    colours: Axes | None = None
    """The last of the axes: those of colours; None where colours say nothing."""

    @classmethod
    def nothing(cls, rows: int) -> LearnedAppearance:
        """Appearance that says nothing of some rows."""
        return cls(np.zeros((rows, 0)), SizeModel.joined([]))


def learn_appearance(
    frame: Ints, appearances: Sequence[Floats], tracklets: Sequence[Ints], person: Ints, frame_rate: float
) -> LearnedAppearance:
    """Learn how much the appearance of a recording's people tells of identity.

    `frame` int64 (n,) is the frame of each row of a trajectory, of which `appearances` float64 (n, k) each are features
    and colours (see `row_looks`), `tracklets` the rows of each isolated tracklet, in the order of time, and `person`
    int64 (n,) the person that each row is thought to be; some may be wrong. `frame_rate` is in frames per second.
    """

    def learned(value: Floats) -> LearnedAppearance:
        halves = _halves(frame, person, np.isfinite(value[:, 0]))
        return _learned(value, frame, tracklets, halves, frame_rate)

    found = [learned(value) for value in appearances]
    value = np.concatenate([one.value for one in found], axis=1)
    return LearnedAppearance(value, SizeModel.joined([one.model for one in found]), found[-1].colours)


def row_looks(trajectory: Rows, appearance: Iterable[Rows]) -> list[Floats]:
    """Features and colours of each row, see `row_means`."""
    return [row_means(trajectory, appearance, name) for name in ("features", "colours")]


def row_means(trajectory: Rows, appearance: Iterable[Rows], name: str) -> Floats:
    """Mean over views of each row's appearance, less the cameras' offsets, float64 (n, k); nan where unknown.

    `appearance` are parts, APPEARANCE (l,) each, of successive frames. They are gone through twice.
    """
    order = np.argsort(trajectory["frame"], kind="stable")
    frames, unknown = trajectory["frame"][order], (len(trajectory), *APPEARANCE[name].shape)
    offsets = _offsets([_Appearances.of(part, name).offset_equations() for part in appearance])
    if not len(offsets):
        return np.broadcast_to(np.nan, unknown)
    mean = np.full(unknown, np.nan)
    for known in (_Appearances.of(part, name) for part in appearance):
        if len(known.value):
            rows = order[slice(*frames.searchsorted(known.places["frame"][[0, -1]] + [0, 1]))]
            detection, row = _same(known.places, _places(trajectory[rows], "raw_x", "raw_y"))
            mean[rows[row]] = known.mean(known.value - offsets[known.view])[detection]
    return mean


@dataclass(frozen=True)
class _Appearances:
    """Known appearances of the detections of some frames."""

    value: Floats
    """float64 (n, k): features or colours by one view."""
    view: Ints
    detection: Ints
    """int64 (n,): camera, and index in `places`, of each."""
    places: Rows
    """Frame and place of each detection, sorted, see `_places`."""

    @classmethod
    def of(cls, appearance: Rows, name: str) -> _Appearances:
        """Features or colours in APPEARANCE (l,), as far as they are known."""
        rows = appearance[np.isfinite(appearance[name]).all(axis=1)]
        places, detection = np.unique(_places(rows, "x", "y"), return_inverse=True)
        return cls(rows[name].astype(np.float64), rows["view"].astype(np.int64), detection.reshape(-1), places)

    def mean(self, value: Floats) -> Floats:
        """Mean over the views of each detection, float64 (detection, k)."""
        number = np.bincount(self.detection)
        return np.stack([np.bincount(self.detection, column) / number for column in value.T], axis=1)

    def offset_equations(self) -> tuple[Floats, Floats]:
        """Normal matrix (view, view) and right sides (view, k) of the cameras' offsets, by least squares."""
        views = int(self.view.max(initial=-1)) + 1
        inside = np.zeros((len(self.places), views))
        inside[self.detection, self.view] = 1.0
        normal = np.diag(inside.sum(axis=0)) - (inside / inside.sum(axis=1, keepdims=True)).T @ inside
        rest = (self.value - self.mean(self.value)[self.detection]).T
        return normal, np.stack([np.bincount(self.view, column, views) for column in rest], axis=1)


def _places(rows: Rows, x: str, y: str) -> Rows:
    """Frame and place of each row, by which a detection and its row of the trajectory are found."""
    places = np.empty(len(rows), [("frame", "<i8"), ("x", "<f8"), ("y", "<f8")])
    places["frame"], places["x"], places["y"] = rows["frame"], rows[x], rows[y]
    return places


def _same(places: Rows, others: Rows) -> tuple[Ints, Ints]:
    """Indices of equal elements of two arrays, the first sorted and without repetitions: int64 (m,) each."""
    at = places.searchsorted(others).clip(max=len(places) - 1)
    other = np.flatnonzero(places[at] == others)
    return at[other], other


def _offsets(equations: Sequence[tuple[Floats, Floats]]) -> Floats:
    """Offset of each camera (view, k), least squares over people that several cameras see at once; their sum is 0."""
    views = max((len(normal) for normal, _ in equations), default=0)
    if not views:
        return np.zeros((0, 0))
    normal = sum(np.pad(part, (0, views - len(part))) for part, _ in equations)
    right = sum(np.pad(sides, ((0, views - len(sides)), (0, 0))) for _, sides in equations)
    return np.asarray(np.linalg.pinv(normal, rcond=1e-9, hermitian=True) @ right)


def _halves(frame: Ints, person: Ints, measured: Flags) -> list[tuple[Ints, Ints]]:
    """Rows of the first and the second half of the time of each person who has enough of both.

    Of more than `_MOST_PEOPLE`, blocks of successive people are taken, and others left out.
    """
    rows = np.flatnonzero(measured)
    rows = rows[np.lexsort((frame[rows], person[rows]))]
    people = np.split(rows, np.flatnonzero(np.diff(person[rows])) + 1)
    long = [one for one in people if len(one) // 2 >= _LEAST_FRAMES]
    long.sort(key=lambda one: (int(frame[one[0]]), int(person[one[0]])))
    share = -(-len(long) // _MOST_PEOPLE)
    kept = [one for k, one in enumerate(long) if k // _PEOPLE_BLOCK % share == 0]
    return [(one[: len(one) // 2], one[len(one) // 2 :]) for one in kept]


def _learned(
    value: Floats, frame: Ints, tracklets: Sequence[Ints], halves: Sequence[tuple[Ints, Ints]], frame_rate: float
) -> LearnedAppearance:
    nothing = LearnedAppearance.nothing(len(value))
    if len(halves) < _LEAST_PEOPLE:
        return nothing
    lasting = independent_frames(value, frame, tracklets, halves)
    if not np.isfinite(lasting):
        return nothing
    # Halves count as people of their own: who was exchanged between them must not seem to vary.
    axes = discriminant_axes(value, [rows for half in halves for rows in half])
    number, along = len(axes.spread), axes.of(value)
    # Where all pairs are far apart, they do not say how long errors last, but differences within tracklets do.
    measured = measured_tracklets(value[:, 0], tracklets)
    errors = constant_errors(np.ascontiguousarray(along.T), frame, measured, prior_errors(1.0, number), frame_rate)
    row_variance = np.maximum(lasting, errors.row_variance(frame_rate))
    # An observation may be of a person in front: under a share of such errors none says more than this against one.
    most_against = np.full(number, -np.log(WRONG) / max(number, 1))
    model = SizeModel(np.zeros(number), np.ones(number), row_variance, axes.spread, most_against)
    return LearnedAppearance(along, model, axes)
