"""The front door in Python: `track`, `Tracker`, rigs from arrays, and what a run gives."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import run_files
from recordings import FRAMES, assert_same, compiled_only, write_recording
from scenes import box_frame_sets, corner_cameras, rig_of, walkers

import stseg
from stseg.arrays import Boxes

RIG = rig_of(corner_cameras())


@pytest.fixture(scope="module")
def rig_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_recording(tmp_path_factory.mktemp("recording"))


@compiled_only
def test_track_does_what_the_command_does(rig_path: Path, tmp_path: Path) -> None:
    from stseg.commands.main import main

    calls: list[tuple[str, int, int | None]] = []
    run = stseg.track(rig_path, tmp_path / "a.h5", frames=(0, 20), progress=lambda *call: calls.append(call))
    assert main(["run", str(rig_path), "-o", str(tmp_path / "b.h5"), "--frames", "0:20"]) == 0
    assert_same(run.path, tmp_path / "b.h5")
    assert calls[-1] == ("tracking", 20, 20)
    with pytest.raises(stseg.InputError, match=r"a\.h5"):
        stseg.track(rig_path, tmp_path / "a.h5", frames=(0, 20))


@compiled_only
def test_a_run_without_an_output_goes_with_its_object(rig_path: Path) -> None:
    run = stseg.track(str(rig_path), frames=(None, 10), tracker="frames", volume="none")
    path = run.path
    assert run.frames.tolist() == list(range(10))
    del run
    assert not path.parent.exists()


@pytest.mark.parametrize(
    "arguments", [{"workers": 0}, {"tracker": "nothing"}, {"frames": (5, 5)}, {"frames": (0, FRAMES + 1)}]
)
def test_errors_are_those_of_the_command(rig_path: Path, arguments: Mapping[str, Any]) -> None:
    with pytest.raises(stseg.InputError, match=r"found .*, expected"):
        stseg.track(rig_path, **arguments)


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


@compiled_only
def test_a_likelihood_is_a_mask_in_other_numbers() -> None:
    mask = np.zeros((len(RIG.cameras), *RIG.cameras[0].size[::-1]), np.uint8)
    mask[:, 20:60, 50:70] = 255
    given: list[Any] = [list(mask), dict(zip([c.name for c in RIG.cameras], mask / 255, strict=True))]
    volumes = []
    for views in given:
        tracker = stseg.Tracker(RIG, tracker="frames")
        volumes.append(np.concatenate([result.log_odds for result in [*tracker.add(views), *tracker.finish()]]))
    np.testing.assert_array_equal(volumes[0], volumes[1])


@compiled_only
def test_frames_that_are_left_out_are_blind() -> None:
    tracker = stseg.Tracker(RIG, tracker="frames")
    boxes = np.zeros((0, 4))
    results = [*tracker.add([boxes] * 4, frame=3), *tracker.add([boxes] * 4, frame=6), *tracker.finish()]
    assert np.concatenate([result.frames for result in results]).tolist() == [3, 4, 5, 6]
    with pytest.raises(stseg.InputError, match="frame 6"):
        tracker.add([boxes] * 4, frame=6)


@pytest.mark.parametrize(
    ("views", "complaint"),
    [
        ([None] * 3, "3 observations, expected 4"),
        ({"nowhere": None}, "nowhere"),
        ([np.zeros((7, 9), np.uint8), None, None, None], "uint8"),
        ([np.full((2, 5), np.nan), None, None, None], "not finite"),
        ([np.array([[0, 0, 4, -1.0]]), None, None, None], "a size of -1"),
        ([np.array([[0, 0, 4, 9, 1.5]]), None, None, None], "a score of 1.5"),
        ([np.full(RIG.cameras[0].size[::-1], 2.0), None, None, None], "outside 0..1"),
        ([np.zeros((*RIG.cameras[0].size[::-1], 3), np.uint8), None, None, None], "empty="),
    ],
)
def test_an_observation_that_does_not_suit_is_one_line(views: Any, complaint: str) -> None:
    with pytest.raises(stseg.InputError, match=complaint):
        stseg.Tracker(RIG).add(views)


@compiled_only
def test_a_camera_keeps_to_its_kind() -> None:
    tracker = stseg.Tracker(RIG, tracker="frames")
    tracker.add([Boxes(np.zeros((0, 4)), np.zeros(0)), None, None, None])
    with pytest.raises(stseg.InputError, match="found masks, expected boxes"):
        tracker.add([np.zeros(RIG.cameras[0].size[::-1], np.uint8), None, None, None])


def test_rigs_from_arrays() -> None:
    matrices, sizes = [camera.projection for camera in RIG.cameras], [camera.size for camera in RIG.cameras]
    one = stseg.Rig.from_projections(matrices, sizes, RIG.grid, 10.0)
    ground, vertical = [camera.ground for camera in RIG.cameras], [camera.vertical for camera in RIG.cameras]
    other = stseg.Rig.from_homographies(ground, vertical, sizes, RIG.grid, 10.0)
    for a, b, camera in zip(one.cameras, other.cameras, RIG.cameras, strict=True):
        np.testing.assert_array_equal(a.projection, b.projection)
        np.testing.assert_allclose(a.projection, camera.projection)
    assert [camera.name for camera in one.cameras] == ["cam1", "cam2", "cam3", "cam4"]
    with pytest.raises(stseg.InputError, match="view, 3, 4"):
        stseg.Rig.from_projections(matrices[0], sizes, RIG.grid, 10.0)
    with pytest.raises(stseg.InputError, match="different names"):
        stseg.Rig.from_projections(matrices, sizes, RIG.grid, 10.0, names=["a"] * 4)


def test_the_volume_is_read_as_it_is_indexed(tmp_path: Path) -> None:
    pytest.importorskip("xarray")
    run = stseg.read_run(run_files.write_small_run(tmp_path / "run.h5"))
    with h5py.File(run.path) as file:
        np.testing.assert_array_equal(run.volume.label[1:3, 0], file["/entry/occupancy/label"][1:3, 0])
    np.testing.assert_array_equal(run.volume_dataset().label.values, np.asarray(run.volume.label))
