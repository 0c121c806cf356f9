"""The Python interface: public names, calls that are commands, and plans."""

import json
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import h5py
import numpy as np
import pytest
from checks import Command, cases, compiled_only, refused
from recordings import FRAMES, OPTIONS, assert_same, track
from run_files import write_small_run
from scenes import box_frame_sets, corner_cameras, rig_of, walkers

import stseg
from stseg.arrays import Boxes
from stseg.commands.main import main
from stseg.engine.observations import as_observation
from stseg.errors import OutputError
from stseg.tasks.forecast import Forecast
from stseg.tasks.warnings import crowd_warnings

RIG = rig_of(corner_cameras())


@compiled_only
def test_track_does_what_the_command_does_with_no_output_too(rig_path: Path, tmp_path: Path) -> None:
    calls: list[tuple[str, int, int | None]] = []
    run = stseg.track(rig_path, tmp_path / "a.h5", frames=(0, 20), progress=lambda *call: calls.append(call))
    assert main(["run", str(rig_path), "-o", str(tmp_path / "b.h5"), "--frames", "0:20"]) == 0
    assert_same(run.path, tmp_path / "b.h5")
    assert calls[-1] == ("tracking", 20, 20)
    refused(stseg.InputError, r"a\.h5", stseg.track, rig_path, tmp_path / "a.h5", frames=(0, 20))
    run = stseg.track(str(rig_path), frames=(None, 10), tracker="frames", volume="none")
    path = run.path
    assert run.frames.tolist() == list(range(10))
    del run
    assert not path.parent.exists()


@compiled_only
def test_a_crowd_that_is_searched_in_part_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stseg.detection.search.frame_search.ENUMERATION_LIMIT", 0)
    monkeypatch.setattr("stseg.detection.search.map_estimate.GAIN_LIMIT", 0)
    tracker, results = stseg.Tracker(RIG, tracker="frames"), []
    for frame_set in box_frame_sets(RIG, walkers(20), 0, 2):
        results += tracker.add([view.pixel for view in frame_set.views if isinstance(view, Boxes)])
    events = np.concatenate([result.events for result in [*results, *tracker.finish()]])
    crowds = events[events["kind"] == b"crowd"]
    assert crowds["frame"].tolist() == [0, 1]
    number = int(crowds["reason"][0].split()[0])
    assert number > 0 and f"in 2 frames, first in frame 0: {number} candidates" in crowd_warnings(events)[0]
    assert crowd_warnings(events[:0]) == []


@pytest.mark.parametrize(
    "arguments",
    [
        {"workers": 0},
        {"tracker": "nothing"},
        {"frames": (5, 5)},
        {"frames": (0, FRAMES + 1)},
        {"frames": range(5)},
    ],
)
def test_errors_are_those_of_the_command(rig_path: Path, arguments: Mapping[str, Any]) -> None:
    refused(stseg.InputError, r"found .*, expected", stseg.track, rig_path, **arguments)


@compiled_only
def test_boxes_in_memory_are_tracked_as_those_of_files(rig_path: Path) -> None:
    recording = stseg.read_recording(rig_path)
    tracker, results = stseg.Tracker(recording.rig), []
    for frame_set in box_frame_sets(recording.rig, walkers(20), 0, 20):
        boxes = [view for view in frame_set.views if isinstance(view, Boxes)]
        results += tracker.add([np.column_stack([view.pixel, view.score]) for view in boxes])
    results += tracker.finish()
    run = stseg.track(rig_path, frames=(0, 20))
    tracks = tracker.tracks(results)
    assert tracks.trajectory.tobytes() == run.trajectory.tobytes()
    assert tracks.boxes.tobytes() == run.boxes.tobytes()
    assert np.concatenate([result.frames for result in results]).tolist() == run.frames.tolist()
    assert np.concatenate([result.label for result in results]).shape == run.volume.label.shape
    assert sum(len(result.detections) for result in results) == len(run.detections)


def test_views_count_in_the_rows_of_frames_that_they_show() -> None:
    rig, results = RIG, []
    tracker = stseg.Tracker(rig)
    for frame_set in box_frame_sets(rig, walkers(20), 0, 20):
        results += tracker.add([None if k == 1 and frame_set.frame >= 12 else v for k, v in enumerate(frame_set.views)])
    rows = tracker.tracks([*results, *tracker.finish()]).trajectory
    views = [set(rows["views"][part].tolist()) for part in (rows["frame"] < 12, rows["frame"] >= 12)]
    assert views == [{4}, {3}]


class Tensor:
    """Numbers on another device: nothing reads them before `cpu`."""

    def __init__(self, *rows: object) -> None:
        self.rows = np.asarray(rows, np.float32)

    def cpu(self) -> np.ndarray:
        return self.rows


def test_detections_of_other_libraries_are_boxes() -> None:
    corners, score, number = [[10, 12, 30, 42], [5, 5, 9, 9], [7, 7, 7, 9]], [0.5, 0.25, 0.75], [0, 2, 0]
    of_supervision = SimpleNamespace(xyxy=np.array(corners), confidence=np.array(score), class_id=np.array(number))
    results = SimpleNamespace(boxes=SimpleNamespace(xyxy=Tensor(*corners), conf=Tensor(*score), cls=Tensor(*number)))
    for given in (of_supervision, results):
        people = as_observation(given, RIG.cameras[0], "frame 0")
        assert isinstance(people, Boxes)
        assert (people.pixel.tolist(), people.score.tolist()) == ([[10, 12, 20, 30]], [0.5])
        others = as_observation(given, RIG.cameras[0], "frame 0", [0, 2])
        assert isinstance(others, Boxes) and others.score.tolist() == [0.5, 0.25]
    bare = SimpleNamespace(xyxy=np.array(corners), confidence=None, class_id=None)
    empty = SimpleNamespace(xyxy=np.zeros((0, 4)), confidence=np.zeros(0), class_id=np.zeros(0, int))
    plain, none = (as_observation(given, RIG.cameras[0], "frame 0") for given in (bare, empty))
    assert isinstance(plain, Boxes) and plain.score.tolist() == [1, 1]
    assert isinstance(none, Boxes) and len(none) == 0
    stseg.Tracker(RIG, classes=[2]).add([of_supervision, results, bare, None])


@compiled_only
def test_likelihoods_are_masks_and_frames_left_out_blind() -> None:
    mask = np.zeros((len(RIG.cameras), *RIG.cameras[0].size[::-1]), np.uint8)
    mask[:, 20:60, 50:70] = 255
    given: list[Any] = [list(mask), dict(zip([c.name for c in RIG.cameras], mask / 255, strict=True))]
    volumes = []
    for views in given:
        tracker = stseg.Tracker(RIG, tracker="frames")
        volumes.append(np.concatenate([result.log_odds for result in [*tracker.add(views), *tracker.finish()]]))
    np.testing.assert_array_equal(volumes[0], volumes[1])
    tracker = stseg.Tracker(RIG, tracker="frames")
    boxes = np.zeros((0, 4))
    results = [*tracker.add([boxes] * 4, frame=3), *tracker.add([boxes] * 4, frame=6), *tracker.finish()]
    assert np.concatenate([result.frames for result in results]).tolist() == [3, 4, 5, 6]
    refused(stseg.InputError, "frame 6", tracker.add, [boxes] * 4, frame=6)
    refused(stseg.InputError, r"frame set after finish", tracker.add, [boxes] * 4)
    tracker = stseg.Tracker(RIG, tracker="frames")
    assert tracker.add([None] * 4, frame=2) == [] == tracker.add({})  # of what kind they are is seen later
    results = [*tracker.add([boxes] * 4), *tracker.finish()]
    assert np.concatenate([result.frames for result in results]).tolist() == [2, 3, 4]
    tracker = stseg.Tracker(RIG, tracker="frames")
    tracker.add([Boxes(np.zeros((0, 4)), np.zeros(0)), None, None, None])
    mask = np.zeros(RIG.cameras[0].size[::-1], np.uint8)
    refused(stseg.InputError, "found masks, expected boxes", tracker.add, [mask, None, None, None])


@pytest.mark.parametrize("frame", [float("nan"), 1.5, "2", 10**9])
def test_numbers_that_are_none_of_a_frame_are_refused(frame: Any) -> None:
    refused(stseg.InputError, "found the number", stseg.Tracker(RIG).add, [np.zeros((0, 4))] * 4, frame=frame)


@cases()
def test_an_observation_that_does_not_suit_is_one_line(shape: list[int], value: Any, kind: str, complaint: str) -> None:
    view = np.broadcast_to(np.array(value, kind), shape)
    refused(stseg.InputError, complaint, stseg.Tracker(RIG).add, [view, None, None, None])


def test_observations_of_other_views_are_refused() -> None:
    refused(stseg.InputError, "3 observations, expected 4", stseg.Tracker(RIG).add, [None] * 3)
    refused(stseg.InputError, "nowhere", stseg.Tracker(RIG).add, {"nowhere": None})


def test_rigs_from_arrays() -> None:
    matrices, sizes = [camera.projection for camera in RIG.cameras], [camera.size for camera in RIG.cameras]
    one = stseg.Rig.from_projections(matrices, sizes, RIG.grid, 10.0)
    ground, vertical = [camera.ground for camera in RIG.cameras], [camera.vertical for camera in RIG.cameras]
    other = stseg.Rig.from_homographies(ground, vertical, sizes, RIG.grid, 10.0)
    for a, b, camera in zip(one.cameras, other.cameras, RIG.cameras, strict=True):
        np.testing.assert_array_equal(a.projection, b.projection)
        np.testing.assert_allclose(a.projection, camera.projection)
    assert [camera.name for camera in one.cameras] == ["cam1", "cam2", "cam3", "cam4"]
    make = stseg.Rig.from_projections
    refused(stseg.InputError, "view, 3, 4", make, matrices[0], sizes, RIG.grid, 10.0)
    refused(stseg.InputError, "different names", make, matrices, sizes, RIG.grid, 10.0, names=["a"] * 4)


def test_a_notebook_reads_the_volume_and_plays_the_film(tmp_path: Path) -> None:
    run = stseg.read_run(write_small_run(tmp_path / "run.h5"))
    assert run._repr_html_().startswith(f"<p>Run({str(run.path)!r}".replace("'", "&#x27;"))
    shown = cv2.imdecode(np.frombuffer(run.plot()._repr_png_(), np.uint8), cv2.IMREAD_COLOR)
    assert shown is not None and shown.shape == run.plot().pixels.shape
    film = run.film(tmp_path / "run.mp4", frames=(10, 12))
    assert cv2.VideoCapture(str(film.path)).get(cv2.CAP_PROP_FRAME_COUNT) == 2
    assert film._repr_html_().startswith("<video")
    refused(OutputError, r"run.mp4: found a file", run.film, tmp_path / "run.mp4")
    with h5py.File(run.path) as file:
        np.testing.assert_array_equal(run.volume.label[1:3, 0], file["/entry/occupancy/label"][1:3, 0])
    pytest.importorskip("xarray")
    np.testing.assert_array_equal(run.volume_dataset().label.values, np.asarray(run.volume.label))


def test_every_public_name_is_there_and_the_command() -> None:
    assert {*stseg.__all__, "__version__"} == set(dir(stseg))
    for name in stseg.__all__:
        assert getattr(stseg, name).__name__ == name
    refused(AttributeError, "nothing_of_that_name", getattr, stseg, "nothing_of_that_name")
    shown = subprocess.run([sys.executable, "-m", "stseg", "--version"], capture_output=True, text=True, check=True)
    assert shown.stdout.strip() == stseg.__version__


@pytest.fixture(scope="module")
def instances(tmp_path_factory: pytest.TempPathFactory) -> dict[str, object]:
    """One large instance of each public class."""
    rig = rig_of(corner_cameras())
    run = stseg.read_run(write_small_run(tmp_path_factory.mktemp("run") / "run.h5"))
    tracker = stseg.Tracker(rig, tracker="frames")
    corners = np.random.default_rng(0).uniform(-1, 1, (50, 2))
    boxes = stseg.Boxes(np.ones((90, 4)), np.ones(90))
    (committed,) = [*tracker.add([np.zeros((0, 4))] * 4), *tracker.finish()]
    return {
        "Boxes": boxes,
        "Camera": rig.cameras[0],
        "CommittedFrames": committed,
        "Config": stseg.Config(),
        "FrameSet": stseg.FrameSet(3, (boxes, None)),
        "Grid": stseg.Grid((-1.0, 1.0), (-1.0, 1.0), polygon=corners),
        "InputError": stseg.InputError("rig.toml", "key", 1, "2"),
        "Lens": stseg.Lens(np.eye(3), np.zeros(8)),
        "Recording": run.recording,
        "Rig": rig,
        "Run": run,
        "Scores": stseg.evaluate(run.trajectory, run.trajectory),
        "Source": run.recording.sources[0].source,
        "StsegError": stseg.StsegError("words"),
        "Tracker": tracker,
    }


@pytest.mark.parametrize("name", stseg.__all__)
def test_a_public_object_shows_itself_in_ten_lines(name: str, instances: dict[str, object]) -> None:
    public = getattr(stseg, name)
    shown = repr(instances[name] if isinstance(public, type) else public)
    assert shown.count("\n") < 10 and len(shown) < 600
    assert not shown.startswith("<stseg")


@compiled_only
def test_the_file_becomes_as_large_as_planned_in_words(rig_path: Path, tmp_path: Path, stdout: Command) -> None:
    plan = json.loads(stdout("plan", rig_path, *OPTIONS, "--workers", "1", "--json"))
    assert (plan["frames"], plan["segments"], plan["workers"]) == (FRAMES, 4, 1)
    assert plan["seconds"] == pytest.approx(
        sum(plan[k] for k in ("starting", "counting", "learning", "tracking", "joining"))
    )
    assert min(plan["tracking"], plan["joining"]) > 0 and track(rig_path, tmp_path / "run.h5") == 0
    assert plan["file_bytes"] == pytest.approx((tmp_path / "run.h5").stat().st_size, rel=0.25)
    printed = stdout("plan", rig_path, *OPTIONS, "--frames", "0:20", "--workers", "3")
    assert all(words in printed for words in ("20 frames", "3 workers", "MiB an hour"))


@compiled_only
def test_plans_share_segments_and_refuse_parts_that_are_none(rig_path: Path, refusal: Command) -> None:
    seconds = [Forecast(1000, 5, workers, 0.5, 0.5, 2.0, 8.0, 3.0, 1).seconds for workers in (1, 2, 3, 5, 9)]
    assert seconds == pytest.approx([14.0, 10.0, 8.0, 6.0, 6.0])
    said = f"--frames: found '10:400', expected a part of the recording's frames, 0:{FRAMES}"
    assert said in refusal("plan", rig_path, "--frames", "10:400")
    assert stseg.plan(rig_path, frames=(0, 1)).frames == 1
