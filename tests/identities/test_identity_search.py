"""The search of identities: against every partition of a few rows, with a short lag, and what sizes say of people."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from reference_identities import crossings, greatest_score, score
from strollers import BORDER, CONFIG, RATE, rows_of, runs, straight, swapped, visit

from stseg.arrays import Floats, Ints, Rows
from stseg.identities.evidence.observations import Observations, observe
from stseg.identities.evidence.size_model import MeasuredSizes, SizeModel, SizePrior, learn_sizes
from stseg.identities.search import beam_search as search
from stseg.identities.search.beam_search import SearchLimits, search_identities
from stseg.identities.search.choice import choose_distinct, empty_present
from stseg.identities.search.costs import crossing, crossings_of
from stseg.identities.search.extension import Alternatives
from stseg.identities.search.hypotheses import Hypotheses, Pasts
from stseg.tracking.windows.isolated_tracklets import isolated_tracklets

MODEL = SizeModel(np.array([1.7]), np.array([0.03**2]), np.array([0.5]), np.array([0.1**2]), np.full(1, np.inf))
LONGEST = 1.0


def seen_of(rows: Rows) -> Observations:
    return observe(rows, rows["height"][:, None].astype(float), MODEL, RATE, BORDER, CONFIG)


def found(seen: Observations, lag: float = 60.0, hypotheses: int = 400) -> Ints:
    return search_identities(seen, MODEL, CONFIG.motion, SearchLimits(hypotheses, LONGEST, lag)).name


@settings(max_examples=60, deadline=None)
@given(runs(2))
def test_no_partition_of_a_few_rows_is_better(rows: Rows) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(search, "_ALTERNATIVE_LOSS", 1e5)
        patch.setattr(search, "_BEAM_LOSS", 1e5)
        seen = seen_of(rows[:7])
        names = found(seen, hypotheses=5000).tolist()
    best = greatest_score(seen, MODEL.spread, CONFIG.motion, LONGEST) if len(rows) else 0.0
    assert score(seen, names, MODEL.spread, CONFIG.motion, LONGEST) == pytest.approx(best, abs=1e-6)


@pytest.mark.parametrize("away", [0.0, 0.2])
def test_two_side_by_side_do_not_pass_through_each_other(away: float) -> None:
    """Two of one height, between two frames exchanged to within `away` metres: less likely than the distance says."""
    rows = rows_of({k: (straight(0, 0.35 * k, 0, 0), 1.7, range(2)) for k in (1, 2)}, noise=0.0)
    rows["y"][rows["frame"] == 1] += away
    seen = seen_of(rows)
    stay, pass_by = (crossings(seen, names, 1, CONFIG.motion) for names in ([0, 1, 0, 1], [0, 1, 1, 0]))
    assert stay == 0.0
    assert pass_by > 0.5
    bend = (CONFIG.motion.speed_spread / RATE / 4) ** 2
    own = crossings_of(0, 2, 4, seen.ground, seen.variance, bend, seen.room)
    last = np.array([0, 1, -1])
    assert crossing(0, 0, 1, 1, last, own) == 0.0
    assert crossing(0, 1, 1, 0, last, own) == pytest.approx(pass_by, abs=1e-4)
    assert crossing(0, 1, 1, 2, last, own) == 0.0  # somebody new has no past


def test_names_that_are_final_early_belong_to_one_hypothesis() -> None:
    """With a lag too short for sizes to tell, rows of a name are still apart in time, and most names are the same."""
    rows = swapped(rows_of({1: (visit(-1), 1.7, range(160)), 2: (visit(1), 1.85, range(160))}), 80)
    seen = seen_of(rows)
    for lag in (0.1, 1.0, 5.0):
        names = found(seen, lag)
        frame = rows["frame"][seen.order]
        assert len(set(zip(frame.tolist(), names.tolist(), strict=True))) == len(rows)
        assert len(set(names.tolist())) <= 4
    np.testing.assert_array_equal(found(seen, 10.0), found(seen))


def test_what_comes_later_counts_where_a_track_is_certain() -> None:
    """Two are exchanged by the filter while they stand together, unmeasured: one hypothesis has to be the right one."""
    true = rows_of({1: (visit(-1), 1.7, range(160)), 2: (visit(1), 1.85, range(160))}, noise=0.0)
    true["height"][(true["frame"] >= 66) & (true["frame"] < 110)] = np.nan
    true["xx"] = true["yy"] = 0.02
    seen = seen_of(swapped(true, 80))
    names, apart = found(seen, hypotheses=1), np.abs(seen.ground[:, 0]) > 0.5
    assert len(np.unique([names[apart], true["id"][seen.order][apart]], axis=1).T) == 2


@pytest.mark.parametrize(
    ("names", "columns", "distinct"),
    [
        ([[0, 3], [1, 3]], [0, 0], 1),  # one begins a frame later, which is the same birth
        ([[0, 3], [2, 3]], [0, 0], 2),  # another birth
        ([[0, 1], [0, 1]], [0, 1], 2),  # two of one birth, of whom either is there
    ],
)
def test_hypotheses_that_differ_in_the_frame_of_a_birth_are_one(
    names: list[list[int]], columns: list[int], distinct: int
) -> None:
    seen = seen_of(rows_of({1: (straight(-3, 0, 0.5, 0), 1.7, range(5))})).rows()
    seen.birth[:] = np.array([1 << 40, 1 << 40, 3 << 40, 5 << 40, 7 << 40])
    held, pasts = Hypotheses.empty(2, 2, 0), Pasts.empty(4, 1)
    held.past[:], pasts.name[:], pasts.last[:] = [[0, 1], [2, 3]], np.ravel(names), 0
    change, value = np.array([[h, -1, -1, -1, -1] for h in range(2)]), np.array([2.0, 1.0])
    chosen, mark = np.empty(2, np.int64), np.zeros(2, np.int64)
    number = choose_distinct(
        held, pasts, np.array(columns)[:, None], 4, seen, mark, Alternatives(change, value), 2, 60.0,
        empty_present(2, 2), chosen,
    )  # fmt: skip
    assert chosen[:number].tolist() == [0, 1][:distinct]


def test_births_within_a_second_of_a_track_are_one() -> None:
    rows = rows_of({1: (straight(-3, 0, 0.5, 0), 1.7, range(20)), 2: (straight(3, 0, 0.5, 0), 1.7, range(20))})
    seen = seen_of(rows)
    birth, track = seen.birth(), rows["id"][seen.order]
    second = np.repeat(np.floor(seen.seconds), np.diff(seen.start))
    assert len(np.unique(birth)) == len(np.unique(np.stack([track, second]), axis=1).T) == 6
    for one in np.unique(birth):
        assert len(np.unique(track[birth == one])) == len(np.unique(second[birth == one])) == 1


def sizes_of(people: Floats, noise: float, seed: int = 0) -> tuple[MeasuredSizes, Ints, list[Ints]]:
    """A size of each person in 80 frames, one tracklet a person."""
    rng = np.random.default_rng(seed)
    value = np.repeat(people, 80) + rng.normal(0, noise, 80 * len(people))
    frame = np.tile(np.arange(80), len(people))
    return MeasuredSizes(value[:, None], [SizePrior(0.05, 0.1)]), frame, np.split(np.arange(len(value)), len(people))


@pytest.mark.parametrize(("most", "people"), [(np.inf, 3), (1.0, 2)])
def test_outliers_say_no_more_against_a_person_than_they_may(most: float, people: int) -> None:
    """Two walk side by side; for a frame one of them is measured far too short."""
    rows = rows_of({k: (straight(-1, 0.5 * k, 0.5, 0), 1.7 + 0.1 * k, range(20)) for k in (1, 2)}, noise=0.0)
    rows["xx"] = rows["yy"] = 0.02
    rows["height"][(rows["id"] == 1) & (rows["frame"] == 10)] = 1.2
    seen = observe(rows, rows["height"][:, None].astype(float), MODEL, RATE, BORDER, CONFIG)
    model = replace(MODEL, most_against=np.full(1, most))
    found = search_identities(seen, model, CONFIG.motion, SearchLimits(50, LONGEST, 60.0)).name
    assert len(np.unique(found)) == people


def test_noise_and_spread_of_a_size_are_learned() -> None:
    people = np.random.default_rng(1).normal(1.7, 0.2, 60)
    model = learn_sizes(*sizes_of(people, 0.03), RATE)
    assert model.noise[0] == pytest.approx(0.03**2, rel=0.15)
    assert model.spread[0] == pytest.approx(0.2**2, rel=0.3)
    assert model.lasting[0] < 3 / RATE


def test_a_size_that_is_everybodys_tells_nobody_apart() -> None:
    model = learn_sizes(*sizes_of(np.full(400, 1.7), 0.03), RATE)
    assert model.spread[0] < 0.012**2


def test_few_people_keep_the_prior() -> None:
    rows = rows_of({1: (visit(-1), 1.7, range(40))})
    tracklets = isolated_tracklets(rows, RATE)
    model = learn_sizes(MeasuredSizes.of_heights(rows["height"], CONFIG), rows["frame"], tracklets, RATE)
    assert model.spread[0] == pytest.approx(0.8 * CONFIG.body.height_spread**2, rel=0.05)
