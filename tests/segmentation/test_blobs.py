"""Blobs of labelled cells and their measures, against plain NumPy."""

import numpy as np
import pytest
from checks import drawn, numbers
from hypothesis import example
from hypothesis import strategies as st

from stseg.arrays import Flags, Floats, Labels, Singles
from stseg.geometry import Grid
from stseg.geometry.nearest_person import nearest_person
from stseg.records.blobs import UNASSIGNED, Blobs
from stseg.segmentation.blob_kernels import fill_centroids, fill_ground_labels
from stseg.segmentation.blobs import find_blobs
from stseg.segmentation.cell_motion import PlacedTracks, motion_field
from stseg.segmentation.patches import GroundPatches, no_squares

_FAINT = 1e-6


def ground_labels(label: Labels, log_odds: Singles) -> Labels:
    """Label with the most mass above each ground cell, int32 (y, x); 0 for none."""
    labels = np.unique(label[label != 0])
    ground_label, most = np.zeros(label.shape[1:], np.int32), np.zeros(label.shape[1:])
    strength = np.nan_to_num(log_odds).clip(0) + _FAINT
    for track_id in labels:
        mass = np.where(label == track_id, strength, 0.0).sum(0)
        ground_label[mass > most] = track_id
        np.maximum(most, mass, out=most)
    return ground_label


GRID = Grid((0.0, 2.0), (0.0, 1.5), cell=0.1, top=1.8, planes=4)
WHOLE = GroundPatches.of(GRID, ~no_squares(GRID))


def test_cells_near_a_person_move_with_them_if_they_do() -> None:
    now = PlacedTracks(np.array([[0.55, 0.55], [1.45, 0.95]]), np.array([4, 7]))
    then = PlacedTracks(np.array([[1.25, 0.85], [0.85, 0.45]]), np.array([7, 4]))
    motion = motion_field(now, then, 0.25, GRID.cell, GRID.ground)
    assert motion[5, 5].tolist() == [-1, 3] and motion[9, 14].tolist() == [-1, -2]
    assert motion[6, 6].tolist() == [-1, 3] and not motion[0, 0].any()
    away = np.hypot(*np.moveaxis(GRID.ground[:, :, None] - now.ground, -1, 0)).min(2)
    np.testing.assert_array_equal(motion.any(2), away <= 0.25)
    for first, second in (([3], []), ([3], [9]), ([], [3])):
        here = PlacedTracks(np.full((len(first), 2), 0.55), np.array(first, np.int64))
        there = PlacedTracks(np.full((len(second), 2), 1.0), np.array(second, np.int64))
        motion = motion_field(here, there, 0.3, GRID.cell, GRID.ground)
        assert motion.shape == (15, 20, 2) and not motion.any()


def disc(*places: tuple[float, float], radius: float = 0.22, tall: int = 3) -> Flags:
    """Occupied cells around places, up to the plane `tall`, bool (plane, y, x)."""
    away = np.hypot(*np.moveaxis(GRID.ground[:, :, None] - np.array(places), -1, 0)).min(2)
    occupied = np.zeros(GRID.shape, bool)
    occupied[: tall + 1] = away <= radius
    return occupied


def blobs_of(occupied: Flags, *standing: tuple[float, float], strength: Floats | float = 2.0) -> Blobs:
    """Blobs of people with tracks 11, 12, ..., the cells within 0.4 m of one given to the nearest of them."""
    ground = np.array(standing).reshape(-1, 2)
    log_odds, tracks = np.where(occupied, strength, -3.0).astype(np.float32), np.arange(len(ground)) + 11
    label = np.where(occupied, np.append(tracks, UNASSIGNED)[nearest_person(GRID.ground, ground, 0.4)], 0)
    return find_blobs(label.astype(np.int32), log_odds, ground, tracks, 0.4, WHOLE)


def test_a_person_is_a_blob_and_a_component_by_itself_too() -> None:
    place = (0.85, 0.75)
    found = blobs_of(disc(place, tall=2), place)
    assert (found.person.tolist(), found.track.tolist()) == ([0], [11])
    np.testing.assert_allclose(found.ground[0], place, atol=1e-9)  # a symmetric mass has its centroid in the middle
    assert found.extent[0] == pytest.approx((found.cells == 1).sum() * 0.01)
    np.testing.assert_array_equal(found.cells > 0, disc(place).any(0))
    assert len(found.touches) == 0
    found = blobs_of(disc((0.45, 0.75), (1.55, 0.75)), (0.45, 0.75))
    assert (found.person.tolist(), found.track.tolist()) == ([0, -1], [11, UNASSIGNED])
    assert len(found.touches) == 0
    np.testing.assert_allclose(found.ground[found.person.tolist().index(-1)], (1.55, 0.75), atol=1e-9)


def test_touching_people_are_two_blobs_and_no_cells_are_one() -> None:
    left, right = (0.65, 0.75), (1.05, 0.75)
    found = blobs_of(disc(left, right), right, left)
    assert sorted(found.person.tolist()) == [0, 1] and found.touches.tolist() == [[0, 1]]
    for blob, who in enumerate(found.person):
        x = (right, left)[who][0]
        cells = GRID.ground[found.cells == blob + 1]
        assert (np.abs(cells[:, 0] - x) <= 0.2 + 1e-9).all()
    np.testing.assert_array_equal(found.cells > 0, disc(left, right).any(0))
    found = blobs_of(disc((0.45, 0.75)), (0.45, 0.75), (1.8, 0.2))
    assert found.person.tolist() == [0, 1] and found.track.tolist() == [11, 12]
    assert found.ground[1].tolist() == [1.8, 0.2] and found.extent[0] > found.extent[1] == 0
    empty = blobs_of(np.zeros(GRID.shape, bool), (0.45, 0.75))
    assert empty.person.tolist() == [0] and not empty.cells.any()
    assert empty.touches.shape == (0, 2)


def test_blobs_are_of_tracks_by_most_mass_and_detections() -> None:
    label = np.zeros(GRID.shape, np.int32)
    label[1, 3, 3], label[1, 3, 8] = 4, 4
    label[1, 9, 3], label[1, 9, 8] = UNASSIGNED, UNASSIGNED
    nobody = np.zeros((0, 2)), np.zeros(0, np.int64)
    found = find_blobs(label, np.ones(GRID.shape, np.float32), *nobody, 0.4, WHOLE)
    assert found.track.tolist() == [4, UNASSIGNED, UNASSIGNED] and found.person.tolist() == [-1, -1, -1]
    np.testing.assert_allclose(found.ground[0], (GRID.ground[3, 3] + GRID.ground[3, 8]) / 2)
    label = np.zeros(GRID.shape, np.int32)
    label[:3, 5, 5], label[3, 5, 5] = 2, 1
    for strength, whose in ((1.0, 2), (9.0, 1)):
        log_odds = np.ones(GRID.shape, np.float32)
        log_odds[3] = strength
        found = find_blobs(label, log_odds, GRID.ground[5, 5][None], np.array([1]), 0.4, WHOLE)
        assert found.track.tolist() == ([1] if whose == 1 else [2, 1])  # a detection without cells comes last
        assert found.person.tolist() == ([0] if whose == 1 else [-1, 0])
    label = disc((0.45, 0.75)).astype(np.int32) * 3
    for x, person in ((0.45, [0]), (0.85, [0]), (0.95, [-1, 0])):  # its outermost cell is at 0.65
        place, track = np.array([[x, 0.75]]), np.array([3])
        found = find_blobs(label, label.astype(np.float32), place, track, 0.4, WHOLE)
        assert found.person.tolist() == person


@drawn(40, st.lists(st.tuples(numbers(0, 2), numbers(0, 1.5)), max_size=4), st.integers(0, 999))
@example([(2.0, 0.0)], 0)
@example([(1.0, 0.0)], 767)
def test_blobs_partition_the_occupied_cells(standing: list[tuple[float, float]], seed: int) -> None:
    rng = np.random.default_rng(seed)
    tracks = rng.permutation(5)[: len(standing)] + 1
    label = np.where(rng.random(GRID.shape) < 0.08, rng.choice([UNASSIGNED, 1, 2, 3], GRID.shape), 0).astype(np.int32)
    log_odds = rng.normal(0, 2, GRID.shape).astype(np.float32)
    log_odds[rng.random(GRID.shape) < 0.1] = np.nan
    found = find_blobs(label, log_odds, np.array(standing).reshape(-1, 2), tracks, 0.4, WHOLE)
    number = int((found.extent > 0).sum())
    np.testing.assert_array_equal(found.cells > 0, (label != 0).any(0))
    assert np.unique(found.cells[found.cells > 0]).tolist() == list(range(1, number + 1))
    for blob in range(number):
        assert (label[:, found.cells == blob + 1] == found.track[blob]).any(0).all()
    known = found.track[:number][found.track[:number] != UNASSIGNED]
    assert len(np.unique(known)) == len(known)
    held = found.person >= 0
    cell = np.rint(GRID.cell_of(np.array(standing).reshape(-1, 2))).astype(int)
    column, row = np.minimum(cell, (GRID.shape[2] - 1, GRID.shape[1] - 1)).T
    visible = np.flatnonzero(np.isfinite(log_odds[:, row, column]).any(0))  # no view says anything about the others
    with_cells = found.person[held & (found.extent > 0)]
    assert sorted(found.person[held].tolist()) == np.union1d(visible, with_cells).tolist()
    np.testing.assert_array_equal(found.track[held], tracks[found.person[held]])
    assert np.isfinite(found.ground).all()
    assert found.extent.sum() == pytest.approx((label != 0).any(0).sum() * 0.01)


@drawn(20, seed=st.integers(0, 2**16))
def test_kernels_of_blobs_agree_with_their_plain_form(seed: int) -> None:
    random = np.random.default_rng(seed)
    label = random.choice(np.array([0, 0, UNASSIGNED, 2, 5, 9], np.int32), GRID.shape)
    log_odds = random.normal(0, 3, GRID.shape).astype(np.float32)
    log_odds[random.random(GRID.shape) < 0.1] = np.nan
    ground_label = np.zeros(GRID.shape[1:], np.int32)
    fill_ground_labels(label, log_odds, ground_label)
    np.testing.assert_array_equal(ground_label, ground_labels(label, log_odds))
    track = np.unique(ground_label[ground_label != 0]).astype(np.int64)
    cells = np.where(ground_label != 0, 1 + track.searchsorted(ground_label), 0).astype(np.int32)
    centroid = np.zeros((len(track), 2))
    fill_centroids(cells, track, label, log_odds, GRID.ground, centroid)
    occupied = (label == np.append(0, track)[cells]) & (label != 0)
    weight = np.where(occupied, np.nan_to_num(log_odds), 0.0).clip(0).sum(0) + _FAINT
    plain = [np.average(GRID.ground[cells == b + 1], 0, weight[cells == b + 1]) for b in range(len(track))]
    np.testing.assert_allclose(centroid, plain, rtol=1e-4, atol=1e-5)
