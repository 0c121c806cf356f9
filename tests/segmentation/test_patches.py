"""GroundPatches of the ground: a window that is cut there alone has the labels of the whole ground."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.lib.stride_tricks import sliding_window_view
from scenes import CONFIG, found, people, room

from stseg.arrays import Floats
from stseg.geometry import Grid
from stseg.records.sparse_volume import SparseVolume
from stseg.segmentation.patches import SQUARE_SIDE, GroundPatches, mark_places, no_squares, people_squares
from stseg.trackers.cut import CutTracker
from stseg.trackers.protocol import Commit, FrameObservations, FusedFrame

GRID = Grid((-6.0, 6.0), (-5.0, 5.0), cell=0.1, top=1.8, planes=3)
FRAMES = 24
UNSEEN = FrameObservations((), ())


def empty_volume(weak: float) -> SparseVolume:
    """Three sets of views in vertical strips: strong, weak and unseen background."""
    of_cell = np.zeros(GRID.shape, np.int32)
    of_cell[:, :, 50:80], of_cell[:, :, 80:] = 1, 2
    return SparseVolume(
        of_cell, np.array([-11.0, weak, np.nan], np.float32), np.zeros(0, np.int32), np.zeros(0, np.float32)
    )


def scene(tracker: CutTracker, frame: int, places: Floats, weak: float) -> FusedFrame:
    """A noisy frame in which people stand at places, a ghost among them who is no person."""
    rng = np.random.default_rng(frame)
    volume, flat = empty_volume(weak), GRID.ground.reshape(-1, 2)
    for place in places:
        near = np.flatnonzero(np.hypot(*(flat - place).T) <= 0.5)
        away = np.hypot(*(flat[near] - place).T)
        volume = volume.with_values(near, (4.0 - 16 * away + rng.normal(0, 1.5, (3, len(near)))).astype(np.float32))
    standing = people(*places[1:])
    return FusedFrame(frame, found(standing, tracker.predict(frame)), found(people()), volume)


def crowd(frame: int) -> Floats:
    """A ghost, two who meet, one who walks fast through weak and unseen background, and one at the border."""
    return np.array([
        (-5.0, 4.0), (-4.0 + 0.05 * frame, 0.0), (-2.0 - 0.05 * frame, 0.2), (-1.0 + 0.25 * frame, 2.0), (5.9, -4.9),
    ])  # fmt: skip


def commits(weak: float) -> list[Commit]:
    tracker = CutTracker(replace(room(), grid=GRID), CONFIG, 0)
    steps = [tracker.add(scene(tracker, frame, crowd(frame), weak), UNSEEN) for frame in range(FRAMES)]
    return [commit for step in (*steps, tracker.finish()) for commit in step]


@pytest.mark.parametrize("weak", [-11.0, -0.5, -0.01])
def test_patches_are_enough(weak: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Labels, tracks, energy and undecided cells of the windows are those of the whole ground."""
    cut_out = commits(weak)
    patches_of = GroundPatches.of
    monkeypatch.setattr(GroundPatches, "of", lambda grid, squares: patches_of(grid, np.ones_like(squares)))
    whole = commits(weak)
    assert sum(len(commit.trajectory) for commit in whole) > 3 * FRAMES
    for one, other in zip(cut_out, whole, strict=True):
        np.testing.assert_array_equal(one.label, other.label)
        for name in ("trajectory", "events", "windows"):
            assert getattr(one, name).tobytes() == getattr(other, name).tobytes()


def test_patches_are_apart_and_hold_marks_and_the_way_ahead() -> None:
    rng = np.random.default_rng(5)
    for _ in range(20):
        squares = no_squares(GRID)
        places = rng.integers(0, GRID.shape[1] * GRID.shape[2], 6)
        mark_places(squares, places, GRID)
        patches = GroundPatches.of(GRID, squares)
        inside = patches.place >= 0
        held = np.bincount(patches.place[inside], minlength=GRID.shape[1] * GRID.shape[2])
        assert held.max() == 1
        grown = held.reshape(GRID.shape[1:])
        for place in places:
            y, x = divmod(int(place), GRID.shape[2])
            assert grown[
                max(y - SQUARE_SIDE, 0) : y + SQUARE_SIDE + 1, max(x - SQUARE_SIDE, 0) : x + SQUARE_SIDE + 1
            ].all()
        np.testing.assert_array_equal(patches.on_ground(patches.on_sheet(grown)), grown)
        edge = patches.on_ground(patches.border)
        beside = np.pad(grown, 1, constant_values=1)
        least = sliding_window_view(beside, (3, 3)).min((2, 3))
        np.testing.assert_array_equal(edge, (grown == 1) & (least == 0))
    here, ahead = np.array([[-4.0, -4.0], [9.0, 9.0]]), np.array([[4.0, 3.0], [9.0, 9.0]])
    assert len(GroundPatches.of(GRID, people_squares(GRID, here, ahead, 0.4)).rectangles) == 1
    assert GroundPatches.of(GRID, no_squares(GRID)).place.tolist() == [[-1]]


def test_log_odds_on_the_sheet() -> None:
    rng = np.random.default_rng(1)
    volume = empty_volume(-0.5).with_values(np.array([5, 77, 6000]), rng.normal(0, 3, (3, 3)).astype(np.float32))
    dense = volume.dense()
    np.testing.assert_array_equal(dense.reshape(3, -1)[:, [6000, 5]], volume.at(np.array([6000, 5])))
    assert set(volume.occupied_places().tolist()) == set(np.flatnonzero((dense > 0).any(0)).tolist())
    squares = no_squares(GRID)
    mark_places(squares, np.array([77, 6000]), GRID)
    patches = GroundPatches.of(GRID, squares)
    sheet, inside = patches.log_odds(volume), patches.place >= 0
    np.testing.assert_array_equal(sheet[:, inside], dense.reshape(3, -1)[:, patches.place[inside]])
    assert (sheet[:, ~inside] < -20).all()
    part = replace(GRID, polygon=np.array([(-6.0, -5.0), (0.0, -5.0), (0.0, 5.0), (-6.0, 5.0)]))
    beside = GroundPatches.of(part, squares).log_odds(volume)
    counts = inside & patches.on_sheet(part.inside())
    assert counts.any() and (inside & ~counts).any()
    np.testing.assert_array_equal(beside[:, counts], sheet[:, counts])
    assert (beside[:, ~counts] < -20).all()
