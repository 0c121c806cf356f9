"""The trackers on crafted scenes: every frame committed once, the same whatever part is run, labels that say who."""

import re
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from checks import compiled_only, refused
from coloured_people import RIG, follow, frame_of, rows_of
from scenes import CONFIG, FRAME_RATE, SIZE, found, no_boxes, people

from stseg.arrays import Floats, Observation, Rows
from stseg.config import BeliefConfig, ParticleConfig
from stseg.errors import ConfigError, SourceError
from stseg.geometry.nearest_person import nearest_person
from stseg.geometry.sampling import Sampling
from stseg.graphcut.grid_energy import QUANTUM
from stseg.records.sparse_volume import SparseVolume
from stseg.records.tables import TRAJECTORY, WINDOW
from stseg.trackers import TRACKERS, Commit, FrameObservations, FusedFrame, TrackingMethod, find_tracker
from stseg.trackers.rows import TrackPlaces, event_rows, fill_views, trajectory_rows
from stseg.tracking.windows.windows import window_length, windows

COLOURED = ("belief", "particles")
"""Trackers that need colour; they have tests of their own."""
COLOURLESS = sorted(set(TRACKERS) - {*COLOURED})
UNSEEN = FrameObservations((None,) * 4, (None,) * 4)
"""Observations for trackers without colour."""
LENGTH, SHARED = window_length(FRAME_RATE, CONFIG.tracking)
ENDS = LENGTH + LENGTH - SHARED
"""A run of so many frames ends exactly where its second window ends."""


def scene(follow: TrackingMethod, frame: int, *places: tuple[float, float]) -> FusedFrame:
    """A frame in which people stand at places, metres: cells within 0.3 m are occupied, one corner is unseen."""
    standing = people(*places)
    log_odds = np.full(RIG.grid.shape, -3.0, np.float32)
    log_odds[:, nearest_person(RIG.grid.ground, standing[:, :2], 0.3) >= 0] = 3.0
    log_odds[:, -1, -1] = np.nan
    return FusedFrame(frame, found(standing, follow.predict(frame)), found(people()), SparseVolume.whole(log_odds))


def crossing(frame: int) -> list[tuple[float, float]]:
    return [(-1.5 + 0.08 * frame, -0.5), (1.5 - 0.08 * frame, 0.4)]


def run(tracker: str, first: int, stop: int, rest: bool = True) -> list[Commit]:
    """Commits of a tracker for frames first .. stop - 1 of two people who pass each other."""
    follow = find_tracker(tracker)(RIG, CONFIG, first)
    done = [new for frame in range(first, stop) for new in follow.add(scene(follow, frame, *crossing(frame)), UNSEEN)]
    return done + follow.finish() if rest else done


@pytest.mark.parametrize("tracker", COLOURLESS)
@pytest.mark.parametrize("frames", [1, 2, 7, 8, 9, LENGTH, LENGTH + 1, ENDS - 1, ENDS, ENDS + 1, 25])
@pytest.mark.parametrize("first", [0, 5])
def test_every_frame_is_committed_once(tracker: str, frames: int, first: int) -> None:
    commits = run(tracker, first, first + frames)
    assert [s.frame for commit in commits for s in commit.frames] == [*range(first, first + frames)]
    for commit in commits:
        assert commit.label.shape == (len(commit.frames), *RIG.grid.shape) and commit.label.dtype == np.int32
        assert set(commit.trajectory["frame"]) <= {s.frame for s in commit.frames}
    rows = rows_of(commits)
    assert len(rows) == 2 * frames and len(np.unique(rows["id"])) == 2
    keys = [(row["frame"], row["id"]) for row in rows]
    assert keys == sorted(set(keys))


@pytest.mark.parametrize("first", [0, 5, 11])
@pytest.mark.parametrize("frames", [1, 9, ENDS, 30])
def test_windows_are_those_of_the_run(first: int, frames: int) -> None:
    rows = np.concatenate([commit.windows for commit in run("cut", first, first + frames)])
    assert rows.dtype == WINDOW
    expected = windows(FRAME_RATE, CONFIG.tracking, first, first + frames)
    ranges = [(w.index, w.solve_first, w.solve_stop, w.commit_first, w.commit_stop) for w in expected]
    committed = rows[["index", "solve_first", "solve_stop", "commit_first", "commit_stop"]].tolist()
    assert committed == ranges
    assert (rows["energy"] < 0).all() and (rows["energy_quantum"] == QUANTUM).all()


def test_no_frames_no_commits_and_unknown_trackers() -> None:
    for tracker in TRACKERS:
        assert find_tracker(tracker)(RIG, CONFIG, 3).finish() == []
    refused(ConfigError, "cut, frames", find_tracker, "magic")


def test_nearest_person_within_reach() -> None:
    standing = np.array([[0.0, 0.0], [1.0, 0.0]])
    asked = np.array([[[0.1, 0.0], [0.6, 0.0]], [[0.5, 2.0], [1.0, 0.4]]])
    assert nearest_person(asked, standing, 0.4).tolist() == [[0, 1], [-1, 1]]
    assert nearest_person(asked, np.zeros((0, 2)), 0.4).tolist() == [[-1, -1], [-1, -1]]


def test_parts_that_the_page_on_contributing_adds_run(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    page = (Path(__file__).parents[2] / "docs" / "development" / "contributing.md").read_text("utf-8")
    added = ModuleType("added")
    exec("\n".join(re.findall(r"```python\n(.*?)```", page, re.DOTALL)), vars(added))
    monkeypatch.setitem(sys.modules, "added", added)
    monkeypatch.setitem(TRACKERS, "nearest", "added:NearestTracker")
    rows = rows_of(run("nearest", 0, 20))
    assert len(rows) == 40 and len(np.unique(rows["id"])) == 2
    np.savetxt(tmp_path / "cam1.txt", np.eye(3, 4))
    (camera,) = added.read_plain([tmp_path / "cam1.txt"])
    assert camera.name == "cam1"
    added.write_json_lines(tmp_path / "rows", SimpleNamespace(trajectory=rows))
    assert len((tmp_path / "rows").read_text("utf-8").splitlines()) == 40


@pytest.mark.parametrize("tracker", COLOURLESS)
def test_labels_say_who(tracker: str) -> None:
    commits = run(tracker, 0, 20)
    assert [at.frame for commit in commits for at in commit.frames] == list(range(20))
    for commit in commits:
        for at, label in zip(commit.frames, commit.label, strict=True):
            own = commit.trajectory[commit.trajectory["frame"] == at.frame]
            assert set(np.unique(label).tolist()) == {0, *own["id"].tolist()}
            for row in own:
                cells = RIG.grid.ground[(label == row["id"]).any(0)]
                away = np.hypot(*(cells - (row["x"], row["y"])).T)
                assert away.max() < 0.45
                assert row["extent"] == pytest.approx(len(cells) * RIG.grid.cell**2)
            np.testing.assert_allclose(np.sort(own["y"]), [-0.5, 0.4])
            # The cut states the log-odds by the whole window, the others those of the frame alone.
            assert (own["score"] > 6.0).all() if tracker == "cut" else (own["score"] == 6.0).all()
            np.testing.assert_allclose(own["height"], 1.7)


@pytest.mark.parametrize("tracker", COLOURLESS)
def test_ids_stay_and_births_are_told(tracker: str) -> None:
    commits = run(tracker, 0, 25)
    for identity in (1, 2):
        own = rows_of(commits)
        own = own[own["id"] == identity]
        assert own["frame"].tolist() == list(range(25))
        assert np.ptp(own["y"]) == 0.0  # each keeps their lane
    events = np.concatenate([commit.events for commit in commits])
    assert [(e["frame"], e["kind"], e["id"]) for e in events] == [(0, b"birth", 1), (0, b"birth", 2)]


def test_what_is_committed_early_does_not_change() -> None:
    """A window is committed as soon as the frame after it comes; what follows does not touch it."""
    early, whole = run("cut", 0, 17, rest=False), run("cut", 0, 30)
    assert 0 < len(early) < len(whole)
    for one, other in zip(early, whole, strict=False):
        for name in ("trajectory", "label", "windows", "events"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_the_cut_parts_who_touches_and_makes_nobody_of_noise() -> None:
    """Two walk side by side, in one piece of occupied cells; one of them is not detected for three frames."""
    follow = find_tracker("cut")(RIG, CONFIG, 0)
    commits: list[Commit] = []
    for frame in range(12):
        x = -1.0 + 0.1 * frame
        both = scene(follow, frame, (x, -0.25), (x, 0.3))
        seen = both if frame not in (4, 5, 6) else scene(follow, frame, (x, -0.25))
        commits += follow.add(replace(seen, made=both.volume), UNSEEN)
    commits += follow.finish()
    rows, labels = rows_of(commits), np.concatenate([commit.label for commit in commits])
    assert np.unique(rows["id"]).tolist() == [1, 2]
    assert [np.count_nonzero(rows["id"] == track) for track in (1, 2)] == [12, 9]
    for row in rows:
        assert abs(row["y"] - (-0.25 if row["id"] == 1 else 0.3)) < 0.15
        own = RIG.grid.ground[(labels[row["frame"]] == row["id"]).any(0)]
        assert (own[:, 1] < 0.1).all() if row["id"] == 1 else (own[:, 1] > -0.1).all()
    # A cell that flickers for one frame is nobody: the pass saw nobody there.
    follow, commits = find_tracker("cut")(RIG, CONFIG, 0), []
    for frame in range(10):
        noisy = scene(follow, frame, (-1.0, -1.0))
        if frame == 4:
            noisy.log_odds[1, 12, 12] = 4.0
        commits += follow.add(noisy, UNSEEN)
    rows = rows_of(commits + follow.finish())
    assert np.unique(rows["id"]).tolist() == [1] and len(rows) == 10


@pytest.mark.parametrize("tracker", COLOURLESS)
def test_frames_without_people_and_whom_a_tracker_expects(tracker: str) -> None:
    follow = find_tracker(tracker)(RIG, CONFIG, 0)
    commits = [commit for frame in range(20) for commit in follow.add(scene(follow, frame), UNSEEN)]
    commits += follow.finish()
    assert sum(len(commit.frames) for commit in commits) == 20
    assert not any(commit.label.any() for commit in commits) and len(rows_of(commits)) == 0
    assert len(follow.predict(20) or ()) == 0
    # Everybody seen so far, where they are now: what is carried is not what was committed, but what was seen.
    follow = find_tracker(tracker)(RIG, CONFIG, 0)
    assert follow.predict(0) is None
    for frame in range(LENGTH + 2):
        follow.add(scene(follow, frame, (-1.5 + 0.1 * frame, 0.2)), UNSEEN)
        expected = follow.predict(frame + 1)
        assert expected is not None and len(expected) == 1
        if frame > LENGTH:  # by then the velocity is known
            np.testing.assert_allclose(expected.ground, [[-1.5 + 0.1 * (frame + 1), 0.2]], atol=0.02)


@compiled_only
@pytest.mark.parametrize("tracker", COLOURED)
def test_equal_seeds_make_equal_tracks(tracker: str) -> None:
    def rows(seed: int) -> Rows:
        little = ParticleConfig(particles=6, raster_columns=64, seed=seed)
        config = replace(CONFIG, particles=little, belief=BeliefConfig(particles=30, seed=seed))
        return rows_of(follow(find_tracker(tracker)(RIG, config, 0), 4, ((-0.9, -0.3, 0.1, 0.0),)))

    np.testing.assert_array_equal(rows(0), rows(0))
    assert (rows(0)["x"] != rows(1)["x"]).any()


@pytest.mark.parametrize("tracker", COLOURED)
def test_without_colour_a_tracker_says_what_it_lacks(tracker: str) -> None:
    masks: list[Observation] = [np.zeros(SIZE[::-1], np.uint8)] * 4
    boxes: list[Observation] = [no_boxes()] * 4
    for given, kind in ((masks, "masks"), (boxes, "boxes"), (masks[:2] + boxes[:2], "boxes and masks")):
        method, seen = find_tracker(tracker)(RIG, CONFIG, 0), FrameObservations(given, [None] * 4)
        said = f"--tracker {tracker}.*frame 3.*{kind} and no colour"
        refused(SourceError, said, method.add, frame_of(3, people((0.0, 0.0))), seen)


def test_rows_are_sorted_and_hold_events_and_views() -> None:
    ground: Floats = np.array([[1.0, 2.0], [3.0, 4.0]])
    covariance = np.array([[[0.1, 0.02], [0.02, 0.3]]] * 2)
    ids, height = np.array([9, 4]), np.array([1.7, 1.8])
    tracks = TrackPlaces(ids, ground, covariance, height, height / 4, height * 3)
    rows = trajectory_rows(7, tracks, height / 2)
    assert rows["id"].tolist() == [4, 9] and rows["frame"].tolist() == [7, 7]
    assert rows[["x", "y", "z", "xx", "xy", "yy"]].tolist()[0] == (3.0, 4.0, 0.0, 0.1, 0.02, 0.3)
    np.testing.assert_allclose(rows["height"], [1.8, 1.7], rtol=1e-6)
    np.testing.assert_allclose(rows["width"], [0.45, 0.425], rtol=1e-6)
    rows = event_rows([(3, "hand-over", 5, 0, "found again after 2 unseen frames")])
    assert rows.tolist() == [(3, b"hand-over", 5, 0, b"found again after 2 unseen frames")]
    assert len(event_rows([])) == 0
    rig = replace(RIG, cameras=(replace(RIG.cameras[0], size=(60, 45)), *RIG.cameras[1:]))
    seen = Sampling.of(rig, "point").views().max(0).reshape(-1).tolist()
    rows = np.zeros(len(seen), TRAJECTORY)
    rows["x"], rows["y"] = rig.grid.ground.reshape(-1, 2).T
    fill_views(rows, rig, {0: np.ones(4, bool)})
    assert rows["views"].tolist() == seen and set(seen) == {3, 4}
    fill_views(rows, rig, {0: np.array([False, True, True, True])})
    assert set(rows["views"].tolist()) == {3}
