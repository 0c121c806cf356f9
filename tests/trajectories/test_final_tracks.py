"""The tracks of a whole run: events, dropped tracks, and smoothed paths."""

from unittest.mock import patch

import numpy as np
import pytest
from checks import drawn, numbers
from hypothesis import strategies as st
from scipy.linalg import block_diag
from simulated_people import BORDER, CONFIG, RATE, committed, gone, rows_of, runs, smoothed, straight, swapped, visit

from stseg.arrays import Floats, Ints, Rows
from stseg.config import MotionConfig
from stseg.identities.search.constraints import Constraints
from stseg.noise.lasting_error import PLACE_ERROR
from stseg.records.tables import APPEARANCE, TRAJECTORY
from stseg.trackers.rows import event_rows
from stseg.trajectories.final_tracks import CommittedRows, FinalTracks, final_tracks
from stseg.trajectories.smoother import smooth_places


def events_of(*events: tuple[int, str, int, int]) -> Rows:
    return event_rows([(*event, "so it was") for event in events])


def lives(rows: Rows) -> Rows:
    """Birth and death of every track, in order."""
    spans = [(int(i), rows["frame"][rows["id"] == i]) for i in np.unique(rows["id"])]
    born = [(int(frames.min()), "birth", i, 0) for i, frames in spans]
    return events_of(*sorted(born + [(int(frames.max()), "death", i, 0) for i, frames in spans]))


def whole(rows: Rows, events: Rows) -> FinalTracks:
    return final_tracks(CommittedRows(rows, events, np.zeros(0, APPEARANCE)), RATE, BORDER, CONFIG)


def story(events: Rows) -> list[tuple[int, bytes, int, int]]:
    return [(int(e["frame"]), bytes(e["kind"]), int(e["id"]), int(e["other"])) for e in events]


def test_births_and_deaths_are_at_end_rows_and_no_reunions() -> None:
    rows = committed(gone(2.0))
    found = whole(rows, lives(rows))
    assert story(found.events) == [(0, b"birth", 1, 0), (40, b"hand-over", 1, 0), (63, b"death", 1, 0)]
    assert found.events["reason"].tolist()[0] == b"so it was"
    assert found.events["reason"].tolist()[1].startswith(b"goes on as 2 of /committed: ")
    assert set(found.identity.tolist()) == {1}
    rows = committed(rows_of({1: (visit(-1), 1.7, range(3, 60))}, noise=0.0))
    beyond = events_of((0, "birth", 1, 0), (1, "birth", 2, 0), (2, "death", 2, 0), (62, "death", 1, 0))
    assert story(whole(rows, beyond).events) == [(3, b"birth", 1, 0), (59, b"death", 1, 0)]


def test_long_gaps_and_raw_places_stay() -> None:
    long, short = (whole(committed(gone(seconds)), events_of()) for seconds in (2.0, 0.5))
    assert long.trajectory["frame"].tolist() == [*range(24), *range(40, 64)]
    assert short.trajectory["frame"].tolist() == list(range(52))
    filled = np.isin(short.trajectory["frame"], range(24, 28))
    assert (short.trajectory["extent"] > 0).tolist() == (~filled).tolist()
    for name in ("raw_x", "raw_y"):
        np.testing.assert_array_equal(np.isnan(short.trajectory[name]), filled)
    assert short.trajectory["xx"][filled].min() > short.trajectory["xx"][10:20].max()
    rows = committed(rows_of({3: (visit(1), 1.7, range(60))}, noise=0.1))
    found = whole(rows, events_of()).trajectory
    np.testing.assert_array_equal(found["raw_x"], rows["x"])
    np.testing.assert_array_equal(found["raw_y"], rows["y"])
    assert (found["x"] != rows["x"]).all() and (found["xx"] < rows["xx"]).all()


def test_events_of_a_swap_are_under_the_names_that_are_right() -> None:
    true = rows_of({1: (visit(-1), 1.7, range(160)), 2: (visit(1), 1.85, range(160))}, noise=0.0)
    rows = committed(swapped(true, 80))
    encounter = events_of((70, "merge", 1, 2), (95, "split", 1, 2))
    found = whole(rows, np.sort(np.concatenate([lives(rows), encounter]), order="frame"))
    apart = ~np.isin(true["frame"], range(72, 89))
    np.testing.assert_array_equal(found.identity[apart], true["id"][apart])
    passed = [one for one in story(found.events) if one[1] == b"hand-over"]
    assert sorted(identity for _, _, identity, _ in passed) == [1, 2]
    assert all(72 <= frame < 89 and other == 0 for frame, _, _, other in passed)
    reasons = {e["id"]: e["reason"] for e in found.events if e["kind"] == b"hand-over"}
    assert all(said.startswith(b"goes on as %d of /committed" % (3 - name)) for name, said in reasons.items())
    assert [one for one in story(found.events) if one[1] != b"hand-over"] == [
        (0, b"birth", 1, 0),
        (0, b"birth", 2, 0),
        (70, b"merge", 1, 2),
        (96, b"split", 1, 2),
        (159, b"death", 2, 0),
        (159, b"death", 1, 0),
    ]


@pytest.mark.parametrize(("other_height", "doubts"), [(1.7, [(1, 2)]), (1.9, [])])
def test_a_meeting_that_no_evidence_decides_is_a_doubt(other_height: float, doubts: list[tuple[int, int]]) -> None:
    rows = committed(rows_of({1: (visit(-1), 1.7, range(160)), 2: (visit(1), other_height, range(160))}))
    events = whole(rows, events_of()).events
    found = events[events["kind"] == b"doubt"]
    assert [(int(e["id"]), int(e["other"])) for e in found] == doubts
    assert all(e["frame"] == 80 and e["reason"].startswith(b"exchanged in this encounter with a prob") for e in found)
    known = Constraints.of([(next_row(rows, 1, 40), next_row(rows, 1, 120))], [])
    told = final_tracks(CommittedRows(rows, events_of(), np.zeros(0, APPEARANCE)), RATE, BORDER, CONFIG, known)
    assert not (told.events["kind"] == b"doubt").any(), "an answer decides it"


def next_row(rows: Rows, track: int, frame: int) -> int:
    return int(np.flatnonzero((rows["id"] == track) & (rows["frame"] == frame))[0])


@drawn(60, runs(5))
def test_tracks_and_events_of_any_run_do_not_contradict(drawn: Rows) -> None:
    rows = committed(drawn)
    found = whole(rows, lives(rows))
    track = found.trajectory
    keys = list(zip(track["frame"].tolist(), track["id"].tolist(), strict=True))
    assert keys == sorted(set(keys))
    kept = found.identity > 0
    assert set(zip(rows["frame"][kept].tolist(), found.identity[kept].tolist(), strict=True)) <= set(keys)
    assert (np.diff(found.events["frame"]) >= 0).all()
    for frame, kind, identity, _ in story(found.events):
        own = track["frame"][track["id"] == identity]
        assert kind != b"birth" or not len(own) or frame == own.min()
        assert kind != b"death" or not len(own) or frame == own.max()
    assert all(found.events["reason"].tolist())


def test_nobody_dropped_tracks_and_a_single_measurement() -> None:
    found = whole(np.zeros(0, TRAJECTORY), events_of())
    assert len(found.trajectory) == len(found.events) == len(found.identity) == 0
    smooth_places(np.zeros(0, TRAJECTORY), SMOOTHER_RATE, MOTION)
    rows = committed(rows_of({5: (visit(1), 1.7, range(40)), 7: (straight(1.0, -2.0, 0, 0), 1.7, range(10, 13))}))
    found = whole(rows, events_of())
    assert found.identity.tolist() == np.where(rows["id"] == 5, 5, 0).tolist()
    assert story(found.events) == [(10, b"dropped", 7, 0)] and set(found.trajectory["id"].tolist()) == {5}
    ground, noise = np.array([[1.0, 2.0]]), np.array([[[0.02, 0.01], [0.01, 0.03]]])
    one = np.ones(1, np.int64)
    for same in zip(smoothed(one, ground, noise, SMOOTHER_RATE, one), (ground, noise), strict=True):
        np.testing.assert_array_equal(*same)


SMOOTHER_RATE = 8.0
MOTION = MotionConfig()
PACE = 0.8


def conditioned(seconds: Floats, ground: Floats, noise: Floats) -> tuple[Floats, Floats]:
    """The same, as one joint Gaussian of all places of one path, conditioned on all measurements at once.

    Nothing is known of the first place (universal kriging); a place at t is first + t v + the twice integrated white
    noise, whose covariance at s <= t is turn^2 s^2 (3 t - s) / 6.
    """
    n, since = len(seconds), seconds - seconds[0]
    early, late = np.minimum.outer(since, since), np.maximum.outer(since, since)
    along = MOTION.velocity_noise**2 * early**2 * (3 * late - early) / 6 + PACE**2 * np.outer(since, since)
    prior, root = np.kron(along, np.eye(2)), block_diag(*np.linalg.cholesky(noise))
    alike = PLACE_ERROR.lasting * np.exp(-np.abs(np.subtract.outer(since, since)) / PLACE_ERROR.seconds)
    error = root @ np.kron(alike, np.eye(2)) @ root.T + PLACE_ERROR.white * block_diag(*noise)
    anywhere, weight = np.tile(np.eye(2), (n, 1)), np.linalg.inv(prior + error)
    of_first = np.linalg.inv(anywhere.T @ weight @ anywhere)
    first = anywhere @ of_first @ anywhere.T @ weight @ ground.ravel()
    mean = first + prior @ weight @ (ground.ravel() - first)
    rest = anywhere - prior @ weight @ anywhere
    covariance = prior - prior @ weight @ prior + rest @ of_first @ rest.T
    return mean.reshape(n, 2), np.stack([covariance[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] for k in range(n)])


@st.composite
def measured(draw: st.DrawFn) -> tuple[Ints, Floats, Floats]:
    """Uneven frames, places and their covariances."""
    frames = np.array(sorted(draw(st.sets(st.integers(0, 40), min_size=1, max_size=12))))
    rng = np.random.default_rng(draw(st.integers(0, 9999)))
    ground = rng.normal(0, 2, (len(frames), 2))
    root = rng.normal(0, draw(numbers(0.05, 0.3)), (len(frames), 2, 2))
    return frames, ground, root @ root.transpose(0, 2, 1) + 1e-3 * np.eye(2)


@drawn(100, measured())
def test_a_path_is_what_all_its_measurements_say_at_once(path: tuple[Ints, Floats, Floats]) -> None:
    frames, ground, noise = path
    places, spread = smoothed(frames, ground, noise, SMOOTHER_RATE, np.ones_like(frames))
    expected, covariance = conditioned(frames / SMOOTHER_RATE, ground, noise)
    np.testing.assert_allclose(places, expected, atol=1e-9, rtol=0)
    np.testing.assert_allclose(spread, covariance, atol=1e-9, rtol=0)
    assert (np.linalg.eigvalsh(spread) > 0).all() and (np.linalg.eigvalsh(noise - spread) > -1e-9).all()


@pytest.mark.parametrize(("yy", "xy"), [(0.0, 0.0), (0.01, 0.01), (0.01, 0.0100001)])
def test_covariances_without_full_rank_are_smoothed(yy: float, xy: float) -> None:
    """Rows that say their place exactly, or along one line, or that float32 has rounded."""
    ground, noise = np.array([[0.1 * k, 0.2] for k in range(4)]), np.tile([[yy, xy], [xy, yy]], (4, 1, 1))
    places, spread = smoothed(np.arange(4), ground, noise, SMOOTHER_RATE, np.ones(4, np.int64))
    assert np.isfinite(places).all() and np.isfinite(spread).all()
    np.testing.assert_allclose(places, ground, atol=0.1)


def test_predicted_rows_of_gaps_are_no_measurements() -> None:
    rows = committed(gone(0.5))
    filled = whole(rows, events_of()).trajectory
    measured = np.isfinite(filled["raw_x"])
    alone = rows[np.argsort(rows["frame"])]
    alone["id"] = 1
    smooth_places(alone, RATE, MOTION)
    for name in ("x", "y", "xx", "xy", "yy"):
        np.testing.assert_allclose(filled[name][measured], alone[name], rtol=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_a_noisy_walk_gets_nearer_to_the_truth(seed: int) -> None:
    """Two people at once, one of them seen in every third frame only; raw places stay."""
    rng = np.random.default_rng(seed)
    rows = np.zeros(80, TRAJECTORY)
    rows["frame"][:60], rows["id"][:60] = range(60), 4
    rows["frame"][60:], rows["id"][60:] = range(0, 60, 3), 2
    seconds = rows["frame"] / SMOOTHER_RATE
    true = np.column_stack([-3 + 0.8 * seconds, np.where(rows["id"] == 4, 1 - 0.2 * seconds, 2.0)])
    rows["xx"] = rows["yy"] = 0.1**2
    rows["raw_x"], rows["raw_y"] = (true + rng.normal(0, 0.1, true.shape)).T
    rows["x"], rows["y"], rows["height"] = rows["raw_x"], rows["raw_y"], 1.7
    rows = rows[np.lexsort((rows["id"], rows["frame"]))]
    true = true[np.lexsort((np.repeat([4, 2], [60, 20]), np.concatenate([np.arange(60), np.arange(0, 60, 3)])))]
    walked = rows.copy()
    smooth_places(walked, SMOOTHER_RATE, MOTION)
    for name in ("frame", "id", "raw_x", "raw_y", "height"):
        np.testing.assert_array_equal(walked[name], rows[name])
    for identity, share in ((4, 0.7), (2, 0.95)):
        own = rows["id"] == identity
        raw, now = (
            float(np.hypot(*(np.column_stack([table[x], table[y]])[own] - true[own]).T).mean())
            for table, x, y in ((rows, "raw_x", "raw_y"), (walked, "x", "y"))
        )
        assert now < share * raw
        assert (walked["xx"][own] < 0.1**2).all()


@drawn(100, measured(), measured())
def test_paths_at_once_are_as_alone(one: tuple[Ints, Floats, Floats], other: tuple[Ints, Floats, Floats]) -> None:
    frames, ground, noise = (np.concatenate(pair) for pair in zip(one, other, strict=True))
    track = np.repeat([1, 2], [len(one[0]), len(other[0])])
    with patch("stseg.trajectories.smoother._ROWS_AT_ONCE", 5):
        both = smoothed(frames, ground, noise, SMOOTHER_RATE, track)
    for rows in (track == 1, track == 2):
        alone = smoothed(frames[rows], ground[rows], noise[rows], SMOOTHER_RATE, track[rows])
        np.testing.assert_array_equal(both[0][rows], alone[0])
        np.testing.assert_array_equal(both[1][rows], alone[1])


def test_no_row_of_a_gap_outlives_its_person() -> None:
    """The row that fills a gap of one track is linked, alone, to somebody who had left."""
    stands = straight(0.0, 0.0, 0.0, 0.0)
    rows = rows_of({1: (stands, 1.7, range(1, 14)), 2: (stands, 1.6, range(24, 25)), 3: (stands, 1.59, range(22, 26))})
    rows = rows[(rows["id"] != 3) | (rows["frame"] != 24)]
    found = whole(committed(rows), lives(rows))
    assert found.trajectory["frame"].tolist() == list(range(1, 14))
    assert found.events["frame"][found.events["id"] == 1].tolist() == [1, 13]
