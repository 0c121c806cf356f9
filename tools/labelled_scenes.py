"""Frames of simulated scenes with the true label of every pixel, for learning and benches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Bytes, Ints, Labels, Singles
from stseg.config import BodyConfig, Config, LabelConfig
from stseg.foreground import make_background
from stseg.foreground.illumination import IlluminationMonitor
from stseg.foreground.view_foreground import ViewForeground
from stseg.geometry import Rig
from stseg.labels.placed_people import PlacedPeople
from stseg.labels.views import ViewLabels, view_labels
from stseg.simulation import Film, SceneSpec

PLACE_ERROR, HEIGHT_ERROR = 0.03, 0.05
"""How far places, along x and y, and heights of a tracker are off, metres: as measured on `easy` with 8 people."""


@dataclass(frozen=True)
class TrueView:
    """One view of one frame.

    Attributes
    ----------
    image : uint8 (v, u, 3)
    foreground : float32 (v, u)
    truth : int32 (v, u)
        1 + the index of the person, 0 for background, -1 for people outside the area, of whom nobody tells.
    """

    image: Bytes
    foreground: Singles
    truth: Labels


@dataclass(frozen=True)
class TrueFrame:
    """One frame: who stands where, about as well as a tracker would know it, and what each view shows."""

    standing: PlacedPeople
    views: Sequence[TrueView]


def film_frames(spec: SceneSpec, every: int, seed: int = 0) -> tuple[Rig, list[TrueFrame]]:
    """Every so manyeth frame of a scene, the foreground learned from its empty room."""
    film, config = Film(spec), Config()
    models = [make_background(camera.size, spec.frame_rate, config.foreground) for camera in film.rig.cameras]
    for images in film.empty():
        for model, image in zip(models, images, strict=True):
            model.learn(image)
    sights = [ViewForeground(IlluminationMonitor(model, spec.frame_rate, config.illumination)) for model in models]
    rng, frames = np.random.default_rng(seed), []
    for moment in film.frame_sets():
        seen = [sight.evidence(view.image) for sight, view in zip(sights, moment.views, strict=True)]
        if moment.frame % every != every // 2:
            continue
        people = moment.truth
        off = rng.normal(0.0, 1.0, (len(people), 3)) * (PLACE_ERROR, PLACE_ERROR, HEIGHT_ERROR)
        standing = PlacedPeople(
            np.stack([people["x"], people["y"]], 1) + off[:, :2],
            np.tile(PLACE_ERROR**2 * np.eye(2), (len(people), 1, 1)),
            people["height"] + off[:, 2],
        )
        views = [
            TrueView(view.image, evidence, _indexed(view.instances, people["id"]))
            for view, evidence in zip(moment.views, seen, strict=True)
            if isinstance(evidence, np.ndarray)
        ]
        frames.append(TrueFrame(standing, views))
    return film.rig, frames


def labels_of(views: Sequence[ViewLabels], frame: TrueFrame) -> list[Labels]:
    """Our labels of all views of a frame."""
    return [
        view.label(frame.standing, seen.foreground, seen.image) for view, seen in zip(views, frame.views, strict=True)
    ]


@dataclass(frozen=True)
class Accuracy:
    """How good labels are, as shares.

    Attributes
    ----------
    found
        Of the pixels that show people, those with the right label.
    kept
        Of the pixels with a label, those that show that person.
    wrong
        Pixels with a wrong label, background included, as a share of those that show people.
    """

    found: float
    kept: float
    wrong: float

    def __str__(self) -> str:
        return f"{self.found:.3f} of the people's pixels right, {self.kept:.3f} of the labels, {self.wrong:.3f} wrong"


def accuracy(rig: Rig, frames: Sequence[TrueFrame], config: LabelConfig) -> Accuracy:
    """That of our labels; pixels of people outside the area count for nothing."""
    views = view_labels(rig, config, BodyConfig())
    right = shown = given = wrong = 0
    for frame in frames:
        for label, seen in zip(labels_of(views, frame), frame.views, strict=True):
            right += int(((label > 0) & (label == seen.truth)).sum())
            shown += int((seen.truth > 0).sum())
            given += int(((label > 0) & (seen.truth >= 0)).sum())
            wrong += int(((label != seen.truth) & (seen.truth >= 0)).sum())
    return Accuracy(right / shown, right / given, wrong / shown)


def _indexed(instances: NDArray[np.uint16], ids: Ints) -> Labels:
    index = np.full(int(max(instances.max(), ids.max(initial=0))) + 1, -1, np.int32)
    index[0] = 0
    index[ids] = np.arange(1, len(ids) + 1)
    return index[instances]
