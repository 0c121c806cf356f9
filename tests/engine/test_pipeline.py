"""The pipeline from observations to tracks, and images beside boxes."""

import gc
import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from itertools import chain, repeat
from operator import attrgetter
from pathlib import Path

import numpy as np
import pytest
from checks import in_ci, refused
from scenes import CONFIG, box_frame_sets, mask_frame_sets, room, walkers

import stseg
from stseg import Boxes, CommittedFrames, Config, FrameSet, evaluate
from stseg.arrays import Ints, Labels, Rows
from stseg.commands.simulate import simulate
from stseg.config import TrackingConfig
from stseg.engine.pipeline import Pipeline
from stseg.engine.session import Session, run_session
from stseg.errors import SourceError
from stseg.foreground.view_foreground import ViewForeground
from stseg.kernels.accelerate import COMPILED
from stseg.records.tables import CANDIDATE, RATES, TIMING, Tracks
from stseg.trajectories.final_tracks import CommittedRows

FRAMES, MASKED, BLIND = (40, 17, 17) if COMPILED else (12, 7, 7)
RIG = room()
TRUTH = walkers(40)
FRAME_SETS = {"pixels": mask_frame_sets, "boxes": box_frame_sets}


@cache
def recording(kind: str, stop: int) -> tuple[FrameSet, ...]:
    return tuple(FRAME_SETS[kind](RIG, TRUTH, 0, stop))


@dataclass(frozen=True)
class Run:
    steps: list[CommittedFrames]
    tracks: Tracks
    identity: Ints
    advanced: list[int]

    @property
    def trajectory(self) -> Rows:
        return np.concatenate([step.commit.trajectory for step in self.steps])

    @property
    def label(self) -> Labels:
        return np.concatenate([step.commit.label for step in self.steps])


def run(
    kind: str, frame_sets: Iterable[FrameSet], tracker: str = "cut", first: int = 0, cores: Iterable[int] = repeat(2)
) -> Run:
    pipeline = Pipeline(RIG, [kind] * len(RIG.cameras), CONFIG, tracker)
    advanced, foregrounds = list[int](), [ViewForeground() for _ in RIG.cameras]
    steps = list(run_session(pipeline, foregrounds, frame_sets, first, advanced.append, iter(cores).__next__))
    trajectory = np.concatenate([step.commit.trajectory for step in steps])
    events, appearance = (np.concatenate([getattr(one, name) for one in steps]) for name in ("events", "appearance"))
    tracks, identity = pipeline.finished(CommittedRows(trajectory, events, appearance))
    return Run(steps, tracks, identity, advanced)


@cache
def whole(kind: str, tracker: str) -> Run:
    return run(kind, recording(kind, FRAMES if kind == "boxes" else MASKED), tracker)


def assert_equal(one: Run, other: Run) -> None:
    """Everything but the time it took, bit for bit."""
    for name in ("label", "trajectory", "tracks.trajectory", "tracks.boxes", "tracks.events", "identity"):
        assert attrgetter(name)(one).tobytes() == attrgetter(name)(other).tobytes(), name
    for a, b in zip(one.steps, other.steps, strict=True):
        for name in ("candidates", "parts", "commit.events", "commit.windows"):
            assert attrgetter(name)(a).tobytes() == attrgetter(name)(b).tobytes(), name
        for x, y in zip(a.commit.frames, b.commit.frames, strict=True):
            np.testing.assert_array_equal(x.log_odds, y.log_odds)


@pytest.mark.parametrize("tracker", ["cut", *in_ci("frames", "kalman")])
@pytest.mark.parametrize("kind", ["pixels", "boxes"])
def test_three_walkers_are_three_tracks(kind: str, tracker: str) -> None:
    done = whole(kind, tracker)
    frames = FRAMES if kind == "boxes" else MASKED
    assert [s.frame for step in done.steps for s in step.commit.frames] == done.advanced == list(range(frames))
    truth = TRUTH[TRUTH["frame"] < frames]
    scores = evaluate(truth, done.tracks.trajectory)
    assert (scores.tracks, scores.switches, scores.false_alarms, scores.misses) == (3, 0, 0, 0)
    assert scores.location_mean is not None and scores.location_mean < (0.05 if kind == "pixels" else 0.1)
    summary = done.tracks.summary()
    assert (summary["frames"] == frames).all()
    assert sorted(np.round(summary["height"], 1)) == pytest.approx([1.6, 1.7, 1.8], abs=0.11)
    # Labels stand where the walkers are.
    for t, label in enumerate(done.label):
        places = truth[truth["frame"] == t]
        occupied = RIG.grid.ground[(label > 0).any(0)]
        away = np.hypot(occupied[:, 0, None] - places["x"], occupied[:, 1, None] - places["y"])
        assert away.min(1).max() < 0.6 and (away.min(0) < 0.3).all()


def test_frames_have_boxes_candidates_and_windows_rates() -> None:
    done = whole("boxes", "cut")
    drawn = done.tracks.boxes
    assert np.unique(drawn["view"]).tolist() == [0, 1, 2, 3]
    for frame_set in recording("boxes", FRAMES)[::4]:
        for view, boxes in enumerate(frame_set.views):
            own = drawn[(drawn["frame"] == frame_set.frame) & (drawn["view"] == view)]
            given = np.column_stack([own["left"], own["top"], own["width"], own["height"]]).astype(float)
            assert isinstance(boxes, Boxes)
            off = np.abs(given[:, None] - boxes.pixel).max(2)
            assert off.min(1).max() < 5
    for step in done.steps:
        assert step.candidates.dtype == CANDIDATE and step.parts.shape == (len(step.candidates), 4)
        assert step.timings.dtype == TIMING and step.rates.dtype == RATES
        assert step.rates["frame"].tolist() == [step.commit.frames[-1].frame] * 4
        assert step.rates["view"].tolist() == [0, 1, 2, 3]
        for scene in step.commit.frames:
            own = step.candidates[step.candidates["frame"] == scene.frame]
            true = own[own["status"] == 1]
            np.testing.assert_array_equal(np.column_stack([true["x"], true["y"]]), scene.people.ground)
            assert (own["evidence"][own["status"] == 0] < 0).all() and (true["evidence"] > 0).all()
    timed = np.concatenate([step.timings for step in done.steps])
    assert {b"foreground", b"detection", b"occupancy", b"tracking"} <= set(timed["stage"].tolist())
    assert (timed["seconds"] >= 0).all()
    candidates = np.concatenate([step.candidates for step in done.steps])
    assert np.unique(candidates["frame"]).tolist() == list(range(FRAMES))
    # A perfect detector: it misses less than was guessed, and people's surroundings are told apart from the rest.
    first, last = done.steps[0].rates, done.steps[-1].rates
    assert (last["miss"] < first["miss"]).all() and (last["person_clutter"] > last["clutter"]).all()


@pytest.mark.parametrize("tracker", ["cut", "frames"])
def test_the_same_recording_twice(tracker: str) -> None:
    """Frame sets may come one by one. No session waits for the collector of cycles, which comes hours later."""
    gc.freeze()
    assert_equal(run("boxes", iter(recording("boxes", FRAMES)), tracker), whole("boxes", tracker))
    assert not any(type(one) is Session for one in gc.get_objects())
    gc.unfreeze()


@pytest.mark.parametrize("kind", ["boxes", "pixels"])
@pytest.mark.parametrize("alone", [7, 10_000])
def test_one_core_alone_and_four_cores_give_the_same(kind: str, alone: int) -> None:
    stop = FRAMES if kind == "boxes" else MASKED
    assert_equal(run(kind, recording(kind, stop), cores=chain(repeat(1, alone), repeat(4))), whole(kind, "cut"))


@pytest.mark.parametrize("first", [3, 8])
def test_a_part_keeps_its_frame_numbers(first: int) -> None:
    stop = min(FRAMES - 1, 17)
    part = run("boxes", recording("boxes", FRAMES)[first:stop], first=first)
    assert [s.frame for step in part.steps for s in step.commit.frames] == part.advanced == list(range(first, stop))
    rows = part.trajectory
    assert np.unique(rows["frame"]).tolist() == part.advanced
    truth = TRUTH[(TRUTH["frame"] >= first) & (TRUTH["frame"] < stop)]
    scores = evaluate(truth, rows)
    assert (scores.tracks, scores.switches, scores.false_alarms, scores.misses) == (3, 0, 0, 0)


@pytest.mark.parametrize("first", [3, 8])
def test_where_a_run_began_is_soon_forgotten(first: int) -> None:
    """A frame's prior comes from the frames before it, so where a run began matters: for a second.

    Its first frame is explained as any first frame is, by itself.
    """
    part = run("boxes", recording("boxes", FRAMES)[first:FRAMES], "frames", first)
    pipeline = Pipeline(RIG, ["boxes"] * 4, CONFIG, "frames")
    views = recording("boxes", FRAMES)[first].views
    alone = pipeline.detector.explain([view for view in views if isinstance(view, Boxes)], None)
    np.testing.assert_array_equal(part.steps[0].commit.frames[0].people.ground, alone.people.ground)
    for k, (step, other) in enumerate(zip(part.steps, whole("boxes", "frames").steps[first:], strict=True)):
        places, others = (np.sort(s.commit.frames[0].people.ground, axis=0) for s in (step, other))
        np.testing.assert_allclose(places, others, atol=0.04 if k < RIG.frame_rate else 0.005)


@pytest.mark.parametrize("frames", [1, 7, 8, 9])
def test_short_recordings(frames: int) -> None:
    done = run("boxes", recording("boxes", FRAMES)[:frames])
    assert [s.frame for step in done.steps for s in step.commit.frames] == list(range(frames))
    assert len(done.trajectory) == 3 * frames
    shortest = round(CONFIG.tracking.minimum_duration * RIG.frame_rate)
    assert len(done.tracks.trajectory) == (3 * frames if frames >= shortest else 0)
    kinds = done.tracks.events["kind"].tolist()
    assert kinds.count(b"birth") == 3 and kinds.count(b"dropped") == (0 if frames >= shortest else 3)
    assert (done.identity == (done.trajectory["id"] if frames >= shortest else 0)).all()


def test_no_frame_sets_and_an_empty_room() -> None:
    pipeline = Pipeline(RIG, ["boxes"] * 4, CONFIG, "cut")
    assert list(run_session(pipeline, [ViewForeground()] * 4, [], 0, lambda _: None)) == []
    for kind in ("pixels", "boxes"):
        done = run(kind, list(FRAME_SETS[kind](RIG, TRUTH[:0], 0, 10)))
        assert done.advanced == list(range(10))
        assert len(done.tracks.trajectory) == len(done.tracks.boxes) == len(done.tracks.events) == 0
        assert not done.label.any()


def test_a_camera_that_goes_blind() -> None:
    """One of four cameras stops in the middle: nobody is lost."""
    frame_sets = [
        frame_set if frame_set.frame < BLIND // 2 else FrameSet(frame_set.frame, (*frame_set.views[:3], None))
        for frame_set in recording("boxes", BLIND)
    ]
    done = run("boxes", frame_sets)
    scores = evaluate(TRUTH[TRUTH["frame"] < BLIND], done.tracks.trajectory)
    assert (scores.tracks, scores.switches, scores.false_alarms, scores.misses) == (3, 0, 0, 0)


CAMERAS, IMAGE_FRAMES = 3, 12
NOTHING = Config(tracking=TrackingConfig(appearance="none"))


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("scene") / "room"
    simulate(folder, scene="demo", people=3, cameras=CAMERAS, seconds=IMAGE_FRAMES / 10, frame_rate=10.0)
    text = (folder / "rig_boxes.toml").read_text()
    images = r'\1\nimages = { kind = "video", path = "\2.avi" }'
    beside = re.sub(r'^(source = .*"(cam\d)_boxes.*)$', images, text, flags=re.MULTILINE)
    assert beside.count("images =") == CAMERAS
    (folder / "beside.toml").write_text(beside)
    return folder


def test_runs_keep_colours_and_read_no_frames_in_vain(scene: Path, tmp_path: Path) -> None:
    run = stseg.track(scene / "beside.toml", tmp_path / "run.h5", volume="none")
    colours = run.appearance["colours"]
    assert len(colours) > 2 * IMAGE_FRAMES and np.isfinite(colours).all()
    assert {"images"} <= {name.decode() for name in run.provenance.sources["role"]}
    gone = tmp_path / "gone.toml"
    text = (scene / "beside.toml").read_text().replace('path = "cam', f'path = "{scene}/cam')
    gone.write_text(re.sub(r'images = .*"', f'images = {{ kind = "video", path = "{tmp_path}/none.avi"', text))
    assert not len(stseg.track(gone, tmp_path / "gone.h5", config=NOTHING, volume="none").appearance)
    refused(SourceError, r"none\.avi", stseg.track, gone, tmp_path / "other.h5", volume="none")
