"""Spoiled masks and boxes: each kind does what it says, the same each time; and what a small corner of them costs."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from checks import in_ci, refused

from stseg import Boxes, Tracker, evaluate
from stseg.arrays import Bytes
from stseg.commands.simulate import simulate
from stseg.errors import ConfigError
from stseg.simulation import NAMED, SceneFilm, Spoil
from stseg.simulation.spoiling.errors import BOX_KINDS, MASK_KINDS, Moment
from stseg.simulation.spoiling.spoil import MAX_STRENGTHS, STRENGTHS, spoiled_boxes, spoiled_mask

MOMENT = Moment(seed=3, camera=0, frame=200, frame_rate=10.0, body_width=20.0)
PEOPLE = np.zeros((120, 160), np.uint16)
PEOPLE[30:90, 40:60], PEOPLE[40:100, 100:120] = 1, 2
MASK = np.where(PEOPLE > 0, 255, 0).astype(np.uint8)
BOXES = Boxes(np.tile([[10.0, 20.0, 30.0, 90.0]], (400, 1)), np.full(400, 0.8))


def spoiled(kind: str, strength: float, moment: Moment = MOMENT) -> Bytes:
    return spoiled_mask(MASK, PEOPLE, [Spoil(kind, strength)], moment)


@pytest.mark.parametrize("kind", MASK_KINDS)
def test_errors_repeat_for_a_frame_and_vanish_at_strength_zero(kind: str) -> None:
    strong = STRENGTHS[kind][2]
    np.testing.assert_array_equal(spoiled(kind, strong), spoiled(kind, strong))
    assert not np.array_equal(spoiled(kind, 1.0 if kind == "flicker" else strong), MASK)
    if kind not in ("jpeg", "shadows"):
        np.testing.assert_array_equal(spoiled(kind, 0.0), MASK)


def test_foreground_is_added_and_people_flicker() -> None:
    for kind in ("shadows", "staying", "rain"):
        added = spoiled(kind, STRENGTHS[kind][2])
        assert (added >= MASK).all() and (added > MASK).any()
    np.testing.assert_array_equal(spoiled("staying", 4, replace(MOMENT, frame=0)), MASK)
    np.testing.assert_array_equal(spoiled("staying", 4), spoiled("staying", 4, replace(MOMENT, frame=300)))
    gone = [not spoiled("flicker", 0.3, replace(MOMENT, frame=frame))[60, 50] for frame in range(1000)]
    blinks = np.array(gone).reshape(-1, 5)
    assert (blinks.all(1) | ~blinks.any(1)).all() and blinks.any(1).mean() == pytest.approx(0.3, abs=0.1)


def test_boxes_jitter_and_silhouettes_grow_and_lose_parts() -> None:
    jittered = spoiled_boxes(BOXES, [Spoil("jitter", 0.1)], MOMENT).pixel
    assert (jittered[:, 0] - 10).std() == pytest.approx(3.0, rel=0.2)
    assert (jittered[:, 1] - 20).std() == pytest.approx(9.0, rel=0.2)
    assert len(spoiled_boxes(BOXES, [Spoil("missed", 0.2)], MOMENT)) == pytest.approx(320, abs=30)
    assert len(spoiled_boxes(BOXES, [Spoil("doubled", 0.2)], MOMENT)) == pytest.approx(480, abs=30)
    assert set(BOX_KINDS) | set(MASK_KINDS) == set(STRENGTHS) == set(MAX_STRENGTHS)
    row = MASK[60, 30:80] > 0
    wider, narrower = spoiled("dilation", 0.3)[60, 30:80] > 0, spoiled("erosion", 0.3)[60, 30:80] > 0
    assert (wider.sum() - row.sum(), row.sum() - narrower.sum()) == (6, 6)
    assert (spoiled("holes", 0.25) > 0).sum() == pytest.approx(0.75 * (MASK > 0).sum(), rel=0.02)
    cut = spoiled("legs", 0.2)
    assert not cut[78:90, 40:60].any() and cut[30:78, 40:60].all()


def test_a_spoiled_film_keeps_all_but_masks_and_boxes() -> None:
    film = SceneFilm(replace(NAMED["tiny"], seconds=0.2))
    other = SceneFilm(film.spec, [Spoil("dilation", 0.3), Spoil("missed", 1.0)])
    for plain, wide in zip(film.frame_sets(), other.frame_sets(), strict=True):
        np.testing.assert_array_equal(plain.truth, wide.truth)
        for a, b in zip(plain.views, wide.views, strict=True):
            np.testing.assert_array_equal(a.image, b.image)
            np.testing.assert_array_equal(a.instances, b.instances)
            assert not len(b.boxes) and (b.mask >= a.mask).all()


def test_the_command_names_kinds_and_strengths(tmp_path: Path) -> None:
    simulate(tmp_path / "a", scene="tiny", seconds=0.1, spoil=("legs:0.5", "missed"))
    simulate(tmp_path / "b", scene="tiny", seconds=0.1)
    masks = [cv2.VideoCapture(str(tmp_path / name / "cam1_masks.avi")).read()[1] for name in "ab"]
    assert 0 < (masks[0] > 0).sum() < (masks[1] > 0).sum()
    for wrong in ("fog", "holes:x", "holes:2", ":1"):
        refused(ConfigError, "spoil", simulate, tmp_path / "c", scene="tiny", spoil=(wrong,))


@pytest.mark.parametrize("kind", ["holes", *in_ci("dilation", "rain")])
def test_a_small_crowd_is_tracked_through_middle_errors(kind: str) -> None:
    spec = replace(NAMED["demo"], people=3, seconds=1.5)
    film = SceneFilm(spec, [Spoil(kind, STRENGTHS[kind][1])])
    tracker, results, truth = Tracker(film.rig), [], []
    for frame_set in film.frame_sets():
        truth.append(frame_set.truth)
        results += tracker.add([view.mask for view in frame_set.views])
    rows = tracker.tracks(results + tracker.finish()).trajectory
    moda = evaluate(np.concatenate(truth), rows, frames=np.arange(film.spec.frames)).moda
    assert moda is not None and moda >= 99.0
