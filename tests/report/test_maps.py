"""Maps of the ground count people where they were and as long as they stayed."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from stseg.arrays import Rows
from stseg.geometry import Grid, Rig
from stseg.records.tables import TRAJECTORY
from stseg.reporting.pictures.maps import Bins, blind_map, density, dwell, dwell_places, heat_map, warm_colours
from stseg.reporting.pictures.plan_map import PlanMap

GRID = Grid((0.0, 4.0), (-1.0, 2.0), 0.5, 1.8, 3)
RIG = Rig("hall", 2.0, GRID, ())
BINS = Bins((0.0, 4.0), (-1.0, 2.0), 1.0)


def rows_of(*rows: tuple[int, int, float, float]) -> Rows:
    """Rows of frame, id, x, y."""
    table = np.zeros(len(rows), TRAJECTORY)
    for name, column in zip(("frame", "id", "x", "y"), zip(*rows, strict=True), strict=False):
        table[name] = column
    return table


def test_density_is_people_a_square_metre() -> None:
    found = density(BINS, rows_of((0, 1, 0.5, -0.5), (1, 1, 0.6, -0.4), (1, 2, 3.9, 1.9), (1, 3, 9, 9)), 2)
    assert found.shape == (3, 4)
    assert (found[0, 0], found[2, 3], found.sum()) == (1, 0.5, 1.5)
    assert density(Bins(BINS.x, BINS.y, 0.5), rows_of((0, 1, 0.2, -0.9)), 1)[0, 0] == 4


def test_a_return_begins_another_stay() -> None:
    home, away = (0.5, -0.5), (2.5, -0.5)
    walk = [home, home, home, home, away, home, home, away]
    found = dwell(BINS, rows_of(*((frame, 1, *place) for frame, place in enumerate(walk))), 2.0)
    assert (found[0, 0], found[0, 2]) == (6 / 2 / 2.0, 2 / 2 / 2.0)  # frames a stay at two frames a second
    two = rows_of((0, 1, *home), (1, 1, *home), (0, 2, *home), (1, 2, *home))
    assert dwell(BINS, two, 2.0)[0, 0] == 1
    assert not dwell(BINS, rows_of(), 2.0).any()


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(st.floats(-1, 5), st.floats(-2, 3)), max_size=50))
def test_every_row_on_the_ground_is_counted_once(places: list[tuple[float, float]]) -> None:
    rows = rows_of(*((k, 1, x, y) for k, (x, y) in enumerate(places)))
    inside = (rows["x"] >= 0) & (rows["x"] < 4) & (rows["y"] >= -1) & (rows["y"] < 2)
    assert BINS.count(BINS.index(rows)).sum() == inside.sum()


def test_bins_are_round_and_never_finer_than_cells() -> None:
    assert Bins.of(GRID).side == 0.5
    assert Bins.of(Grid((0, 5), (0, 5), 0.1)).side == 0.25
    assert Bins.of(Grid((0, 30), (0, 5), 0.1)).side == 1.0


def test_haunts_are_where_most_time_is_spent() -> None:
    rng = np.random.default_rng(3)
    waiting = rng.normal((1.0, 0.0), 0.1, (300, 2))
    talking = rng.normal((3.0, 1.0), 0.1, (100, 2))
    passing = rng.uniform((0, -1), (4, 2), (20, 2))
    places = np.concatenate([waiting, talking, passing])
    found = dwell_places(
        rows_of(*((k, 1, x, y) for k, (x, y) in enumerate(places.tolist()))), Bins(BINS.x, BINS.y, 0.25)
    )
    assert len(found) == 2
    np.testing.assert_allclose([(place.x, place.y) for place in found], [(1, 0), (3, 1)], atol=0.15)
    np.testing.assert_allclose([place.share for place in found], [300 / 420, 100 / 420], atol=0.04)


def test_nobody_dwells_where_all_walk_alike() -> None:
    even = np.stack(np.meshgrid(np.arange(0.05, 20, 0.25), np.arange(0.05, 20, 0.25)), -1).reshape(-1, 2)
    rows = rows_of(*((k, 1, x, y) for k, (x, y) in enumerate(even.tolist())))
    assert dwell_places(rows, Bins((0.0, 20.0), (0.0, 20.0), 0.5)) == []
    assert dwell_places(rows[:0], BINS) == []


def test_a_heat_map_is_dark_where_much_is() -> None:
    values = np.zeros(BINS.shape)
    values[2, 3], values[0, 0] = 8.0, 2.0
    picture = heat_map(RIG, BINS, values, "title", "units").astype(int)
    plan = PlanMap.fit(GRID, np.zeros((0, 2)), 900, 900)
    tones = []
    for place in ((3.3, 1.3), (0.3, -0.7), (0.3, 1.3)):
        u, v = np.rint(plan.pixel(np.array(place))).astype(int)
        tones.append(picture[v, u].sum())
    assert tones[0] < tones[1] < tones[2]
    assert heat_map(RIG, BINS, np.zeros(BINS.shape), "", "").shape == picture.shape
    brightness = warm_colours(np.linspace(0, 1, 9), 1.0).astype(int).sum(axis=1)
    assert (np.diff(brightness) < 0).all()


def test_blind_ground_is_red() -> None:
    views = np.full(GRID.shape, 1, np.uint8)
    views[:, 0, 0] = 0  # least x, least y
    picture = blind_map(RIG, views)
    plan = PlanMap.fit(GRID, np.zeros((0, 2)), 900, 900)
    u, v = np.rint(plan.pixel(np.array([0.25, -0.65]))).astype(int)
    blue, green, red = picture[v, u].tolist()
    assert red > 150 > max(blue, green)
