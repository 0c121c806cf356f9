"""Where cells move, and the blobs that the cut leaves."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import numbers

from stseg.arrays import Flags, Floats
from stseg.geometry import Grid
from stseg.segmentation.blobs import Blobs, find_blobs
from stseg.segmentation.motion import motion_field

GRID = Grid((0.0, 2.0), (0.0, 1.5), cell=0.1, top=1.8, planes=4)

# Motion


def test_cells_near_a_person_move_with_them() -> None:
    now = np.array([[0.55, 0.55], [1.45, 0.95]])
    then = np.array([[1.25, 0.85], [0.85, 0.45]])
    motion = motion_field(now, then, np.array([4, 7]), np.array([7, 4]), 0.25, GRID)
    assert motion[5, 5].tolist() == [-1, 3]
    assert motion[9, 14].tolist() == [-1, -2]
    assert motion[6, 6].tolist() == [-1, 3]
    assert not motion[0, 0].any()
    away = np.hypot(*np.moveaxis(GRID.ground[:, :, None] - now, -1, 0)).min(2)
    np.testing.assert_array_equal(motion.any(2), away <= 0.25)


def test_whoever_is_not_found_again_stays() -> None:
    here = np.array([[0.55, 0.55]])
    for chains_then in ([], [9]):
        then = np.tile([[1.0, 1.0]], (len(chains_then), 1))
        motion = motion_field(here, then, np.array([3]), np.array(chains_then, np.int64), 0.3, GRID)
        assert motion.shape == (15, 20, 2)
        assert not motion.any()
    assert not motion_field(np.zeros((0, 2)), here, np.zeros(0, np.int64), np.array([3]), 0.3, GRID).any()


# Blobs


def disc(*places: tuple[float, float], radius: float = 0.22, tall: int = 3) -> Flags:
    """Occupied cells around places, up to the plane `tall`, bool (plane, y, x)."""
    away = np.hypot(*np.moveaxis(GRID.ground[:, :, None] - np.array(places), -1, 0)).min(2)
    occupied = np.zeros(GRID.shape, bool)
    occupied[: tall + 1] = away <= radius
    return occupied


def blobs_of(occupied: Flags, *standing: tuple[float, float], strength: Floats | float = 2.0) -> Blobs:
    log_odds = np.where(occupied, strength, -3.0).astype(np.float32)
    return find_blobs(occupied, log_odds, np.array(standing).reshape(-1, 2), 0.4, GRID)


def test_a_person_is_a_blob() -> None:
    place = (0.85, 0.75)
    found = blobs_of(disc(place, tall=2), place)
    assert found.person.tolist() == [0]
    np.testing.assert_allclose(found.ground[0], place, atol=1e-9)  # a symmetric mass has its centroid in the middle
    assert found.extent[0] == pytest.approx((found.cells == 1).sum() * 0.01)
    assert found.height[0] == pytest.approx(1.2)
    assert found.mass[0] == pytest.approx(2.0)
    np.testing.assert_array_equal(found.cells > 0, disc(place).any(0))
    assert len(found.touches) == 0
    spread = np.linalg.eigvalsh(found.covariance[0])
    assert ((spread > 0) & (spread < 0.1**2)).all()


def test_the_centroid_follows_the_mass() -> None:
    place = (0.85, 0.75)
    heavier = np.where(GRID.ground[..., 0] > 0.85, 6.0, 1.0)
    found = blobs_of(disc(place), place, strength=heavier)
    assert found.ground[0, 0] > 0.88
    assert found.ground[0, 1] == pytest.approx(0.75)


def test_touching_people_are_divided() -> None:
    left, right = (0.65, 0.75), (1.05, 0.75)
    found = blobs_of(disc(left, right), right, left)
    assert sorted(found.person.tolist()) == [0, 1]
    assert found.touches.tolist() == [[0, 1]]
    for blob, who in enumerate(found.person):
        x = (right, left)[who][0]
        cells = GRID.ground[found.cells == blob + 1]
        assert (np.abs(cells[:, 0] - x) <= 0.2 + 1e-9).all()
    np.testing.assert_array_equal(found.cells > 0, disc(left, right).any(0))


def test_a_piece_without_a_person_is_kept() -> None:
    found = blobs_of(disc((0.45, 0.75), (1.55, 0.75)), (0.45, 0.75))
    assert sorted(found.person.tolist()) == [-1, 0]
    assert len(found.touches) == 0
    unknown = found.person.tolist().index(-1)
    np.testing.assert_allclose(found.ground[unknown], (1.55, 0.75), atol=1e-9)


def test_people_without_cells_are_no_blobs() -> None:
    found = blobs_of(disc((0.45, 0.75)), (0.45, 0.75), (1.8, 0.2))
    assert found.person.tolist() == [0]
    empty = blobs_of(np.zeros(GRID.shape, bool), (0.45, 0.75))
    assert len(empty.person) == len(empty.ground) == 0
    assert not empty.cells.any()
    assert empty.touches.shape == (0, 2)


@settings(deadline=None, max_examples=40)
@given(st.lists(st.tuples(numbers(0, 2), numbers(0, 1.5)), max_size=4), st.integers(0, 999))
def test_blobs_partition_what_is_occupied(standing: list[tuple[float, float]], seed: int) -> None:
    rng = np.random.default_rng(seed)
    occupied = rng.random(GRID.shape) < 0.08
    log_odds = rng.normal(0, 2, GRID.shape).astype(np.float32)
    log_odds[rng.random(GRID.shape) < 0.1] = np.nan
    found = find_blobs(occupied, log_odds, np.array(standing).reshape(-1, 2), 0.4, GRID)
    number = len(found.person)
    np.testing.assert_array_equal(found.cells > 0, occupied.any(0))
    assert np.unique(found.cells[found.cells > 0]).tolist() == list(range(1, number + 1))
    held = found.person[found.person >= 0]
    assert len(np.unique(held)) == len(held)
    assert np.isfinite(found.ground).all()
    assert (np.linalg.eigvalsh(found.covariance) > 0).all()
    assert found.extent.sum() == pytest.approx(occupied.any(0).sum() * 0.01)
