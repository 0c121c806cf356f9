"""Track labels of cells: subgraphs, shares of tracks, division of touching people, predicted places."""

from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest
import reference_expansion as reference
from checks import drawn, numbers
from hypothesis import strategies as st

from stseg.arrays import Flags, Floats, Ints, Labels
from stseg.config import MotionConfig, SegmentationConfig, TrackingConfig
from stseg.geometry import Grid
from stseg.graphcut.cell_subset import CellSubset, subset
from stseg.graphcut.expansion import LabelEnergy, expand
from stseg.graphcut.grid_energy import QUANTUM, GridEnergy
from stseg.graphcut.solvers import SOLVERS
from stseg.records.blobs import UNASSIGNED
from stseg.records.predicted_tracks import PredictedPlaces
from stseg.segmentation.cell_labelling import WindowDetections, label_cells
from stseg.segmentation.cell_motion import successor_cells
from stseg.segmentation.cut_energy import build_energy, neighbourhood
from stseg.segmentation.label_energy import BodyShape, label_energy, track_shares
from stseg.segmentation.patches import GroundPatches, no_squares
from stseg.tracking.filter.prediction import DetectionHistory, earlier_detections, predicted_places, together
from stseg.tracking.windows.tracklets import Tracklet

GRID = Grid((0.0, 2.4), (0.0, 1.4), cell=0.1, top=1.8, planes=4)
WHOLE = GroundPatches.of(GRID, ~no_squares(GRID))
BODY = BodyShape(reach=0.4, height_spread=0.12, prior_share=0.02)
CONFIG = TrackingConfig()


def random_window(seed: int, shape: tuple[int, ...]) -> GridEnergy:
    rng = np.random.default_rng(seed)
    frames, _, rows, columns = shape
    motion = rng.integers(-2, 3, (frames - 1, rows, columns, 2))
    offsets = neighbourhood(8 if seed % 2 else 80)
    capacity = rng.integers(1, 9, len(offsets)).astype(np.int32)
    return GridEnergy(rng.integers(-20, 21, shape).astype(np.int32), offsets, capacity, successor_cells(motion))


@drawn(25, st.integers(0, 999), st.sampled_from([(3, 2, 3, 4), (2, 3, 4, 3), (1, 2, 3, 3), (4, 1, 1, 5)]))
def test_a_subgraph_has_the_edges_of_its_window(seed: int, shape: tuple[int, ...]) -> None:
    energy = random_window(seed, shape)
    inside = np.random.default_rng(seed).random(shape) < 0.6
    subgraph = subset(energy, inside)
    assert subgraph.cell.tolist() == np.flatnonzero(inside).tolist()
    within = inside.ravel()
    every = list(zip(*(side.tolist() for side in energy.edges()), strict=True))
    listed = sorted(zip(subgraph.cell[subgraph.start], subgraph.cell[subgraph.end], subgraph.weight, strict=True))
    assert listed == sorted((p, q, w) for p, q, w in every if within[p] and within[q])
    border = np.zeros(within.size, np.int64)
    for p, q, w in every:
        border[p] += w * (within[p] and not within[q])
        border[q] += w * (within[q] and not within[p])
    assert subgraph.border.tolist() == border[within].tolist()


@pytest.mark.parametrize("seed", range(5))
def test_whole_components_of_a_subgraph(seed: int) -> None:
    energy = random_window(seed, (2, 2, 4, 5))
    subgraph = subset(energy, np.random.default_rng(seed).random((2, 2, 4, 5)) < 0.4)
    component = subgraph.components()
    assert (component[subgraph.start] == component[subgraph.end]).all()
    kept = component % 2 == 0
    only = subgraph.only(kept)
    inside = np.zeros(energy.unary.size, bool)
    inside[subgraph.cell[kept]] = True
    same = subset(energy, inside.reshape(energy.unary.shape))
    for one, other in zip(vars(only).values(), vars(same).values(), strict=True):
        np.testing.assert_array_equal(one, other)


def places_at(
    *tracks: tuple[float, float], frames: int = 1, spread: float = 0.05, height: float = 1.7
) -> PredictedPlaces:
    """Tracks 1, 2, ... that stand still, metres."""
    size = (frames, len(tracks))
    ground = np.tile(np.array(tracks, float).reshape(-1, 2), (frames, 1, 1))
    covariance = np.tile(np.eye(2) * spread**2, (*size, 1, 1))
    return PredictedPlaces(1 + np.arange(len(tracks)), np.ones(size, bool), ground, covariance, np.full(size, height))


@drawn(40, numbers(0.6, 1.2), numbers(0.4, 1.0), numbers(0, 2.2), numbers(0.01, 0.3), st.booleans())
def test_shares_by_definition(x: float, y: float, height: float, spread: float, gone: bool) -> None:
    places = places_at((0.8, 0.7), (1.1, 0.6), spread=spread)
    places.expected[0, 1] = not gone
    places.height[0], places.covariance[0, 1] = (1.4, 1.9), 2 * places.covariance[0, 0]
    cell = np.array([x, y])
    share = track_shares(np.zeros(1, np.int64), cell[None], np.array([height]), places, BODY)[0]
    expected = reference.share(0, cell, height, places, BODY)
    np.testing.assert_allclose(share, expected, atol=2e-3)  # less than that is out of reach
    assert share.sum() == pytest.approx(1.0)
    assert (share[1] == 0) == gone or share[1] < 2e-3


def test_costs_of_labels_by_gate_in_quanta() -> None:
    ground = np.array([[0.5, 0.7], [1.9, 0.8], [1.2, 0.0]])
    share = track_shares(np.zeros(3, np.int64), ground, np.ones(3), places_at((0.5, 0.7), (1.9, 0.7)), BODY)
    assert (share > 0).tolist() == [[True, False, True], [False, True, True], [False, False, True]]
    assert share[2, -1] == 1.0 and share[0, 0] > 0.95
    subgraph = CellSubset(np.array([3, 5]), np.array([0]), np.array([1]), np.array([7]), np.array([2, 0]))
    energy = label_energy(np.array([1000, -50]), np.array([[0.5, 0.0, 0.5], [0.0, 1.0, 0.0]]), subgraph)
    half = round(np.log(2) / QUANTUM)
    assert (energy.first.tolist(), energy.label.tolist()) == ([0, 2, 3], [1, 3, 2])
    assert energy.cost.tolist() == [half - 998, half - 998, 50]


def bodies(tracks: Floats, radius: float = 0.24) -> Labels:
    """True label of each cell: the nearest track within a radius; tracks float64 (time, k, 2), metres."""
    away = np.hypot(*np.moveaxis(GRID.ground[None, :, :, None] - tracks[:, None, None], -1, 0))
    whose = np.where(away.min(3) <= radius, 1 + away.argmin(3), 0)
    return np.repeat(whose[:, None], GRID.planes, 1).astype(np.int32)


def window_of(truth: Labels, seed: int = 1) -> GridEnergy:
    """A window with noisy log-odds of the truth."""
    noise = np.random.default_rng(seed).normal(0, 0.7, truth.shape)
    log_odds = (np.where(truth > 0, 2.5, -2.5) + noise).astype(np.float32)
    still = np.zeros((len(truth) - 1, *GRID.shape[1:], 2), np.int64)
    return build_energy(log_odds, successor_cells(still), GRID, SegmentationConfig())


def divided(
    energy: GridEnergy, places: PredictedPlaces, seen: Flags | None = None, solver: str = "stseg"
) -> tuple[Flags, Labels]:
    """Cut and labels; a track not seen in a frame is still predicted there."""
    seen = places.expected if seen is None else seen
    found = WindowDetections(
        [ground[who] for ground, who in zip(places.ground, seen, strict=True)], [places.track[who] for who in seen]
    )
    occupied = SOLVERS[solver].grid(energy).occupied
    return occupied, label_cells(energy, occupied, found, places, BODY, WHOLE, SOLVERS[solver])


def meeting(frames: int = 5) -> Floats:
    """Two tracks that approach to 0.36 m and part again, float64 (time, 2, 2)."""
    apart = 0.36 + 0.12 * np.abs(np.arange(frames) - frames // 2)
    return np.stack([np.column_stack([1.2 + side * apart / 2, np.full(frames, 0.7)]) for side in (-1, 1)], 1)


def walking(tracks: Floats) -> PredictedPlaces:
    """Places of tracks that are detected in all frames."""
    return replace(places_at(*tracks[0], frames=len(tracks)), ground=tracks)


def test_people_are_divided_by_expansion_only_where_they_touch() -> None:
    tracks = meeting()
    truth = bodies(tracks)
    energy = window_of(truth)
    occupied, label = divided(energy, walking(tracks))
    assert subset(energy, occupied).components().max() == 0  # one piece of space and time
    both = (truth > 0) & (label > 0)
    assert (label[both] == truth[both]).mean() > 0.98 and both.sum() > 0.98 * (truth > 0).sum()
    assert not label[~occupied].any()
    tracks = meeting() + np.array([[-0.6, 0.0], [0.6, 0.0]])
    truth = bodies(tracks)
    with patch("stseg.segmentation.cell_labelling.expand", side_effect=AssertionError("no two touch")):
        occupied, label = divided(window_of(truth), walking(tracks))
    assert (label[occupied] != 0).all()
    both = (truth > 0) & occupied
    np.testing.assert_array_equal(label[both], truth[both])


@pytest.mark.parametrize("seed", range(3))
def test_both_solvers_give_the_same_labels(seed: int) -> None:
    tracks = meeting()
    energy = window_of(bodies(tracks), seed)
    (occupied, ours), (peer, theirs) = (divided(energy, walking(tracks), solver=name) for name in SOLVERS)
    np.testing.assert_array_equal(occupied, peer)
    np.testing.assert_array_equal(ours, theirs)


def test_tracks_keep_cells_where_missed_not_where_elsewhere() -> None:
    tracks = meeting()
    truth = bodies(tracks)
    seen = np.ones(tracks.shape[:2], bool)
    seen[1:4, 1] = False
    _, label = divided(window_of(truth), walking(tracks), seen)
    missed = truth[2] == 2
    assert (label[2][missed] == 2).mean() > 0.9
    # Track 2 is expected, and found, off the grid in one frame: what stands here then is of track 1.
    energy = window_of(bodies(tracks))
    gone = tracks.copy()
    gone[2, 1] = 3.0, 0.7
    _, label = divided(energy, walking(gone))
    assert set(np.unique(label[2])) <= {0, 1, UNASSIGNED} and 2 in label[1]


def test_unclaimed_cells_are_unassigned_and_empty_windows() -> None:
    three = np.concatenate([meeting(), np.tile([0.3, 0.3], (5, 1, 1))], 1)
    truth = bodies(three)
    _, label = divided(window_of(truth), walking(meeting()))
    unknown = truth == 3
    assert (label[unknown] == UNASSIGNED).mean() > 0.97
    lonely, alone = divided(window_of(bodies(three[:, 2:])), walking(meeting()))
    assert set(np.unique(alone[lonely])) == {UNASSIGNED}
    energy = window_of(np.zeros((2, *GRID.shape), np.int32))
    occupied, label = divided(energy, places_at((1.0, 0.7), frames=2))
    assert not occupied.any() and not label.any()


@pytest.mark.parametrize("seed", range(3))
def test_only_the_components_need_expansion(seed: int) -> None:
    """The same labels as an expansion over every cell of the window, from the same start."""
    tracks = meeting(3)
    places = walking(tracks)
    energy = window_of(bodies(tracks), seed)
    occupied, label = divided(energy, places)
    whole = subset(energy, np.ones_like(occupied))
    frame, plane, y, x = np.unravel_index(whole.cell, occupied.shape)
    share = track_shares(frame, GRID.ground[y, x], GRID.heights[plane], places, BODY)
    problem: LabelEnergy = label_energy(energy.unary.ravel(), share, whole)
    start: Ints = np.where(occupied.ravel(), problem.cheapest_labels(), 0)
    everywhere = np.array([0, 1, 2, UNASSIGNED])[expand(problem, start)]
    outside = ~occupied.ravel()
    assert not everywhere[outside].any()
    if subset(energy, occupied).components().max() == 0:
        np.testing.assert_array_equal(everywhere, label.ravel())


def detections(*found: tuple[int, int, float, float]) -> DetectionHistory:
    """Rows of frame, chain, x, y."""
    rows = np.array(found, float).reshape(-1, 4)
    n = len(rows)
    frame, chain = rows[:, :2].T.astype(np.int64)
    return DetectionHistory(frame, chain, rows[:, 2:], np.tile(np.eye(2) * 0.01, (n, 1, 1)), np.full(n, 1.8))


def test_places_between_and_after_detections_of_tracks() -> None:
    history = detections((14, 7, 1.4, 0.0), (10, 7, 1.0, 0.0), (12, 3, 0.0, 5.0))
    places = predicted_places(history, 8, 20, 8.0, CONFIG)
    assert places.track.tolist() == [3, 7]
    # From the first detection on, for as long as a track can be predicted.
    ahead = int(CONFIG.prediction_horizon * 8.0)
    frames = np.arange(8, 20)
    assert frames[places.expected[:, 1]].tolist() == list(range(10, 14 + ahead + 1))
    assert frames[places.expected[:, 0]].tolist() == list(range(12, 12 + ahead + 1))
    np.testing.assert_allclose(places.ground[2:9, 1, 0], np.arange(1.0, 1.65, 0.1))
    np.testing.assert_allclose(places.ground[4:7, 0], [[0.0, 5.0]] * 3)
    spread = places.covariance[:, 1, 0, 0]
    assert spread[2] == spread[6] == pytest.approx(0.01)
    assert spread[2] < spread[3] < spread[4] > spread[5] and spread[6] < spread[7] < spread[8]
    assert (places.height[places.expected] == 1.8).all()
    nothing = together([earlier_detections([], 4, 1.7, MotionConfig()), detections()])
    places = predicted_places(nothing, 4, 9, 8.0, CONFIG)
    assert places.ground.shape == (5, 0, 2) and places.expected.shape == (5, 0)


def test_places_are_carried_from_the_window_before() -> None:
    tail = Tracklet(5)
    for frame in range(6, 12):
        tail.add(frame, 0, np.array([0.1 * frame, 1.0]))
    before = earlier_detections([tail], 10, 1.7, MotionConfig())
    assert before.frame.tolist() == [6, 7, 8, 9]
    places = predicted_places(together([before, detections((11, 5, 1.2, 1.0))]), 10, 12, 8.0, CONFIG)
    np.testing.assert_allclose(places.ground[0, 0], [1.05, 1.0])
    alone = predicted_places(before, 10, 12, 8.0, CONFIG)
    np.testing.assert_allclose(alone.ground[:, 0], [[1.0, 1.0], [1.1, 1.0]])
    assert (alone.height == 1.7).all()
