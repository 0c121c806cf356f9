"""The trials of `targets`: recordings on which the least scores are promised, each with what the cameras deliver."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from pathlib import Path

import cv2
import numpy as np

from experiments.spoil import EXACT, NAMES, Shown, recorded
from stseg.arrays import Bytes, Observation, Rows
from stseg.evaluation.sequence import Area
from stseg.geometry import Rig
from stseg.io.recording.frames import open_frames
from stseg.io.recording.rigs import read_recording
from stseg.io.track_csv import read_tracks_csv
from stseg.simulation import NAMED, SceneFilm, SceneSpec, Spoil
from stseg.simulation.rendering.render import RenderedView
from stseg.simulation.spoiling.errors import BOX_KINDS, MASK_KINDS
from stseg.simulation.spoiling.spoil import STRENGTHS

MIDDLE = NAMES.index("middle")
PLAZA_SEEDS = (1706, 2311)
CMC_AREA = (1.9, -0.3, 6.2, 3.5)


@dataclass(frozen=True)
class Recorded:
    """What cameras deliver, frame by frame, and the truth.

    Attributes
    ----------
    rig, truth
    frames
        The observations of all cameras, one tuple a frame.
    area
        The rectangle that is scored, None for all.
    empty
        By camera: images of the empty scene, of those that deliver colour.
    """

    rig: Rig
    truth: Rows
    frames: Sequence[tuple[Observation, ...]]
    area: Area | None = None
    empty: dict[str, list[Bytes]] = field(default_factory=dict)

    def seen_by(self, chosen: Sequence[int]) -> Recorded:
        """The same by some cameras."""
        rig = replace(self.rig, cameras=tuple(self.rig.cameras[k] for k in chosen))
        return replace(self, rig=rig, frames=[tuple(views[k] for k in chosen) for views in self.frames])


@dataclass(frozen=True)
class Trial:
    """One recording of a target's mean.

    Attributes
    ----------
    target
        In the words of the table.
    name
        Of the recording.
    least
        Least MODA and IDF1, percent.
    make
        Makes it, of so many frames at most.
    """

    target: str
    name: str
    least: tuple[float, float]
    make: Callable[[int], Recorded]


def trials(data: Path, work: Path) -> Iterator[Trial]:
    """All of them; `work` holds uu4.toml, cmc2_fairmot.toml and cmc2.csv."""
    yield from _uu4(work / "uu4.toml", data / "uu4" / "reference_tracks.csv")
    yield from _cmc2(work / "cmc2_fairmot.toml", work / "cmc2.csv")
    for kind in (EXACT, *MASK_KINDS, *BOX_KINDS):
        yield Trial("easy, each spoil of middle strength", f"easy {kind}", (96, 96), _easy(kind))
    for kind in ("masks", "colour"):
        yield Trial("adults and children", f"school {kind}", (97, 97), filmed(NAMED["school"], kind))
    yield Trial("adults and children, from boxes", "school boxes", (97, 97), filmed(NAMED["school"], "boxes"))
    yield Trial("dense4", "dense4 colour", (93, 85), filmed(NAMED["dense4"], "colour"))
    yield from _plazas()


def _plazas() -> Iterator[Trial]:
    for seed in PLAZA_SEEDS:
        for wide in (0.5, 0.4, 0.6):
            spec = replace(NAMED["plaza"], seed=seed, cylinder=wide)
            yield Trial("plaza", f"plaza {wide:g} m, seed {seed}", (98.5, 98), filmed(spec, "masks"))
    for seed in PLAZA_SEEDS:
        spec = replace(NAMED["plaza"], seed=seed)
        small = replace(spec, size=(spec.size[0] // 2, spec.size[1] // 2))
        half, grown = filmed(small, "masks"), _changed(filmed(spec, "masks"), lambda mask: _grown(mask, 2))
        yield Trial("plaza, half size or dilated", f"plaza half size, seed {seed}", (97, 96), half)
        yield Trial("plaza, half size or dilated", f"plaza dilated by 2, seed {seed}", (97, 96), grown)
    large = replace(NAMED["plaza"], area=(40.0, 40.0), camera_distance=34.0, cameras=8, people=10, seed=PLAZA_SEEDS[0])
    for name, spec in (("20 m", replace(NAMED["plaza"], seed=PLAZA_SEEDS[0])), ("40 m", large)):
        target = "plaza, each camera off by 2 pixels"
        yield Trial(target, f"plaza of {name}, off by 2 pixels", (97, 96), _misplaced(filmed(spec, "masks"), 2.0))


def _uu4(rig: Path, truth: Path) -> Iterator[Trial]:
    def whole(most: int) -> Recorded:
        shown = recorded(rig, truth, 0, min(136, most))
        return Recorded(shown.rig, shown.truth, [tuple(view.mask for view in views) for views in shown.frames])

    def torn(most: int) -> Recorded:
        shown = recorded(rig, truth, 0, min(136, most))
        return Recorded(shown.rig, shown.truth, list(shown.spoiled([Spoil("holes", 0.25)], False)))

    spoiled = {
        "dilated by 6": _changed(whole, lambda mask: _grown(mask, 6)),
        "eroded by 4": _changed(whole, lambda mask: _grown(mask, -4)),
        "25 % holes": torn,
    }
    yield Trial("uu4", "uu4", (99.4, 99.4), whole)
    for name, make in spoiled.items():
        yield Trial("uu4, spoiled", f"uu4 {name}", (99, 99), make)
    yield from _subsets("uu4", 4, whole, {3: (98.5, 0), 2: (94, 0)})


def delivered(rig: Path, truth: Path, stop: int, area: Area | None = None) -> Recorded:
    """A recording's first frames."""
    recording, rows = read_recording(rig), read_tracks_csv(truth)
    with open_frames(recording, 0, stop) as sets:
        frames = [frame_set.views for frame_set in sets]
    return Recorded(recording.rig, rows[rows["frame"] < stop], frames, area)


def _cmc2(rig: Path, truth: Path) -> Iterator[Trial]:
    def whole(most: int) -> Recorded:
        return delivered(rig, truth, min(261, most), CMC_AREA)

    yield from _subsets("cmc2, fairmot", 4, whole, {3: (97, 92), 2: (90, 80)})


def _subsets(
    name: str, views: int, whole: Callable[[int], Recorded], least: dict[int, tuple[float, float]]
) -> Iterator[Trial]:
    for number, scores in least.items():
        for chosen in combinations(range(views), number):
            named = "".join(str(k + 1) for k in chosen)
            yield Trial(f"{name}, {number} views", f"{name} views {named}", scores, _seen_by(whole, chosen))


def _seen_by(whole: Callable[[int], Recorded], chosen: Sequence[int]) -> Callable[[int], Recorded]:
    return lambda most: whole(most).seen_by(chosen)


def _changed(whole: Callable[[int], Recorded], change: Callable[[Bytes], Bytes]) -> Callable[[int], Recorded]:
    def make(most: int) -> Recorded:
        made = whole(most)
        return replace(made, frames=[tuple(change(np.asarray(view, np.uint8)) for view in one) for one in made.frames])

    return make


def _misplaced(whole: Callable[[int], Recorded], pixels: float) -> Callable[[int], Recorded]:
    """A recording whose calibration is off in each camera, by so many pixels in a direction of its own."""

    def make(most: int) -> Recorded:
        made, cameras = whole(most), []
        for k, camera in enumerate(made.rig.cameras):
            angle, shift = 2.4 * k, np.eye(3)
            shift[:2, 2] = pixels * np.cos(angle), pixels * np.sin(angle)
            cameras.append(replace(camera, ground=shift @ camera.ground, vertical=shift @ camera.vertical))
        return replace(made, rig=replace(made.rig, cameras=tuple(cameras)))

    return make


def _grown(mask: Bytes, pixels: int) -> Bytes:
    """A mask dilated by some pixels; eroded by a negative number."""
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * abs(pixels) + 1,) * 2)
    return np.asarray(cv2.dilate(mask, disc) if pixels > 0 else cv2.erode(mask, disc), np.uint8)


def _easy(kind: str) -> Callable[[int], Recorded]:
    def make(most: int) -> Recorded:
        rig, truth, frames = _rendered(NAMED["easy"], most, keep_images=False)
        shown = Shown(rig, truth, frames)
        spoils = [] if kind == EXACT else [Spoil(kind, STRENGTHS[kind][MIDDLE])]
        return Recorded(rig, truth, list(shown.spoiled(spoils, kind in BOX_KINDS)))

    return make


def filmed(spec: SceneSpec, kind: str) -> Callable[[int], Recorded]:
    """A simulated scene by masks, boxes or colour."""

    def make(most: int) -> Recorded:
        rig, truth, frames = _rendered(spec, most, kind == "colour")
        name = {"masks": "mask", "boxes": "boxes", "colour": "image"}[kind]
        views = [tuple(getattr(view, name) for view in one) for one in frames]
        if kind != "colour":
            return Recorded(rig, truth, views)
        before = list(zip(*SceneFilm(spec).empty(), strict=True))
        empty = {camera.name: list(own) for camera, own in zip(rig.cameras, before, strict=True)}
        return Recorded(rig, truth, views, empty=empty)

    return make


def _rendered(spec: SceneSpec, most: int, keep_images: bool) -> tuple[Rig, Rows, list[tuple[RenderedView, ...]]]:
    seconds = min(spec.seconds, most / spec.frame_rate)
    film, frames, truth = SceneFilm(replace(spec, seconds=seconds)), [], []
    nothing = np.zeros((0, 0, 3), np.uint8)
    for frame_set in film.frame_sets():
        frames.append(tuple(view if keep_images else replace(view, image=nothing) for view in frame_set.views))
        truth.append(frame_set.truth)
    return film.rig, np.concatenate(truth), frames
