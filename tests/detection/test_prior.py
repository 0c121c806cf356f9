"""The prior of a frame: predicted tracks, their assignment, and the cost of births."""

import math
from dataclasses import replace

import numpy as np
import pytest
import reference_core as reference
from checks import compiled_only, drawn, numbers
from hypothesis import strategies as st
from scenes import corner_cameras, expecting, looking, rig_of
from scipy.stats import multivariate_normal, norm

from stseg.arrays import Floats
from stseg.config import BodyConfig, DetectionConfig
from stseg.detection.prior import Prior
from stseg.geometry import Grid, Rig
from stseg.records.border import Border
from stseg.records.candidates import Candidates
from stseg.records.predicted_tracks import PredictedTracks, no_tracks
from stseg.records.sizes import Sizes

CONFIG, BODY = DetectionConfig(), BodyConfig()
PLACES = st.tuples(numbers(-2, 2), numbers(-2, 2))
SPREADS = st.tuples(numbers(0.05, 0.6), numbers(0.05, 0.6), numbers(-0.9, 0.9)).map(
    lambda s: np.array([[s[0] ** 2, s[0] * s[1] * s[2]], [s[0] * s[1] * s[2], s[1] ** 2]])
)
TRACKS = st.tuples(PLACES, SPREADS, numbers(1.4, 2.0), numbers(0.03, 0.12), numbers(-6, 1))
CANDIDATES = st.tuples(PLACES, numbers(1.0, 2.0))


def population(height: float) -> float:
    """Log density of a height in the population: Gaussian within two spreads, a power law of exponent 4 beyond."""
    deviation = abs(height - BODY.height_mean) / BODY.height_spread
    peak = norm.logpdf(0.0, scale=BODY.height_spread)
    return peak - (deviation**2 / 2 if deviation < 2 else 2 + 4 * math.log(deviation / 2))


def tracks_of(tracks: list[tuple[tuple[float, float], Floats, float, float, float]]) -> PredictedTracks:
    place, covariance, height, sd, odds = zip(*tracks, strict=True)
    sizes = Sizes(np.array(height), np.array(sd) ** 2, np.full(len(sd), 0.42), np.array(sd) ** 2)
    return PredictedTracks(np.array(place), np.array(covariance), sizes, np.array(odds))


@drawn(100, st.lists(TRACKS, min_size=1, max_size=3), st.lists(CANDIDATES, max_size=3))
def test_log_ratio_of_a_track_by_hand(
    tracks: list[tuple[tuple[float, float], Floats, float, float, float]],
    candidates: list[tuple[tuple[float, float], float]],
) -> None:
    """The ratio of two hypotheses: this track, at its place and height, or a birth, anywhere and of any height."""
    ground = np.array([place for place, _ in candidates]).reshape(-1, 2)
    height = np.array([tall for _, tall in candidates])
    log_ratio = tracks_of(tracks).track_log_ratio(ground, height, BODY, CONFIG.prior_log_odds)
    assert log_ratio.shape == (len(candidates), len(tracks))
    anywhere = -math.log(2 * math.pi * 0.1**2)  # at the resolution of a frame, which is 0.1 m
    for j, (place, tall) in enumerate(candidates):
        birth = CONFIG.prior_log_odds + anywhere + population(tall)
        for k, (at, covariance, height_k, sd, odds) in enumerate(tracks):
            shape = norm.logpdf(tall, height_k, sd)
            least = population(tall) - 4.0  # people stoop and sit
            track = odds + multivariate_normal.logpdf(place, at, covariance) + max(shape, least)
            assert log_ratio[j, k] == pytest.approx(track - birth, abs=1e-6)


def test_log_density_of_a_place_and_of_no_tracks() -> None:
    expected = expecting((0.3, -0.4), (1.0, 1.0))
    points = np.array([[0.3, -0.4], [0.5, -0.4], [0.3, 0.2]])
    log_density = expected.place_log_density(np.array([1, 0]), points[[[2, 1, 0], [0, 1, 2]]])
    for k, track in enumerate((1, 0)):
        normal = multivariate_normal(expected.ground[track], expected.covariance[track])
        by_hand = normal.logpdf(points) - normal.logpdf(expected.ground[track])
        np.testing.assert_allclose(log_density[k], by_hand[[[2, 1, 0], [0, 1, 2]][k]], atol=1e-9)
    assert len(no_tracks()) == 0
    assert no_tracks().track_log_ratio(np.zeros((3, 2)), np.full(3, 1.7), BODY, CONFIG.prior_log_odds).shape == (3, 0)
    assert no_tracks().track_log_ratio(np.zeros((0, 2)), np.zeros(0), BODY, CONFIG.prior_log_odds).shape == (0, 0)
    assert expecting((0, 0)).track_log_ratio(np.zeros((0, 2)), np.zeros(0), BODY, CONFIG.prior_log_odds).shape == (0, 1)


def open_ground(grid: Grid) -> Rig:
    """An area that the corner cameras see whole."""
    return Rig("area", 8.0, grid, tuple(looking(c.name, (*c.centre[:2] * 3, 8.0), focal=150) for c in corner_cameras()))


@pytest.mark.parametrize(
    "polygon", [None, [(-1.7, -1.6), (1.8, -1.2), (0.3, 1.7)], [(-2, -2), (2, -2), (2, 2), (0, 0.1), (-2, 2)]]
)
@pytest.mark.parametrize("cameras", [0, 2])
def test_distance_by_trying_all_cells(polygon: list[tuple[float, float]] | None, cameras: int) -> None:
    """The nearest cell that is outside the area, or that no view sees at the height of a trunk."""
    corners = None if polygon is None else np.array(polygon, float)
    grid = Grid((-2.0, 2.0), (-2.0, 2.5), 0.25, 1.8, 2, corners)
    narrow = [looking("a", (-4.0, 0.0, 2.0), size=(60, 96)), looking("b", (0.0, -4.0, 2.0), size=(40, 96))]
    rig = Rig("part", 8.0, grid, tuple(narrow[:cameras]) or open_ground(grid).cameras)
    is_seen = np.zeros(grid.shape[1:], bool)
    for camera in rig.cameras:
        image, ahead = camera.project(grid.ground, 1.0)
        is_seen |= ahead & camera.inside(image)
    assert is_seen.all() == (cameras == 0)
    expected = reference.away_from_border(is_seen & grid.inside(), grid.cell)
    np.testing.assert_allclose(Border.of(rig).distance, expected, atol=1e-9)


def test_unseen_places_are_outside_and_births_cost_inside() -> None:
    ahead = looking("ahead", (0.0, 0.0, 1.5), target=(2.0, 0.0, 1.0))
    border = Border.of(rig_of([ahead]))
    np.testing.assert_array_equal(border.away(np.array([[-1.5, 0.0], [-0.2, 1.0]])), 0.0)
    assert border.away(np.array([[1.5, 0.1]]))[0] > 0.2
    border = Border.of(open_ground(Grid((-3.0, 3.0), (-3.0, 3.0), 0.1, 1.8, 2)))
    places = np.array([[-2.95, 0.0], [-2.45, 0.0], [-1.95, 0.0], [0.0, 0.0], [-3.5, 0.0]])
    later = Prior.of(no_tracks(), CONFIG, BODY, border)
    share = np.array([0.05, 0.55, 1.0, 1.0, 0.0])
    np.testing.assert_allclose(later.birth_cost(places), share * CONFIG.birth_cost, atol=1e-6)
    np.testing.assert_array_equal(Prior.of(None, CONFIG, BODY, border).birth_cost(places), 0.0)


@compiled_only
def test_births_cost_nothing_at_doors_and_all_at_walls() -> None:
    rig = open_ground(Grid((-3.0, 3.0), (-3.0, 3.0), 0.1, 1.8, 2))
    places = np.array([[0.0, 0.0], [0.5, 0.0], [1.3, 0.0], [-2.95, 0.0], [-3.5, 0.0]])
    door = (-0.2, -0.1, 0.2, 0.1)
    shares = {
        (): ([1.0, 1.0, 1.0, 0.05, 0.0], [1.0, 1.0, 1.0, 1.0, 0.0]),
        (door,): ([0.0, 0.3, 1.0, 0.05, 0.0], [0.0, 0.3, 1.0, 1.0, 0.0]),
    }
    for doors, (unwalled, walled) in shares.items():
        for closed, share in ((False, unwalled), (True, walled)):
            border = Border.of(replace(rig, doors=doors, closed=closed))
            cost = Prior.of(no_tracks(), CONFIG, BODY, border).birth_cost(places)
            np.testing.assert_allclose(cost, np.array(share) * CONFIG.birth_cost, atol=0.06 * CONFIG.birth_cost)


@pytest.mark.parametrize("closed", [False, True])
def test_tracks_in_doors_are_candidates_and_outside_none(closed: bool) -> None:
    corners = np.array([[-2.0, -2.0], [2.0, -2.0], [2.0, 2.0], [-2.0, 2.0]])
    rig = open_ground(Grid((-3.0, 3.0), (-3.0, 3.0), 0.1, 1.8, 2, corners))
    border = Border.of(replace(rig, doors=((-0.2, -0.1, 0.2, 0.1),), closed=closed))
    prior = Prior.of(expecting((0.0, 0.0), (2.5, 0.0), (1.0, 0.5), (0.0, -9.0)), CONFIG, BODY, border)
    np.testing.assert_array_equal(prior.pool().ground, [[0.0, 0.0], [1.0, 0.5]])
    assert len(prior.predicted) == 4  # they stay expected, should the frame itself find them


def test_tracks_are_candidates_of_their_heights() -> None:
    prior = Prior.of(expecting((0.1, 0.2, 1.3), (0.4, 0.5, 1.74)), CONFIG, BODY, Border.of(rig_of(corner_cameras())))
    pool = prior.pool()
    np.testing.assert_array_equal(pool.ground, [[0.1, 0.2], [0.4, 0.5]])
    np.testing.assert_array_equal(pool.height, [1.3, 1.74])
    assert prior.track_log_ratio(pool).shape == (2, 2)
    assert prior.track_log_ratio(Candidates(np.zeros((0, 2)), np.zeros(0), np.zeros(0))).shape == (0, 2)
    tall = [population(h) for h in (1.5, BODY.height_mean)]
    np.testing.assert_allclose(np.diff(prior.log_height(np.array([1.5, BODY.height_mean]))), np.diff(tall))
