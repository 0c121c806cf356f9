"""Boxes from videos: `stseg detect`, and runs whose rig names a detector."""

import json
import re
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partialmethod
from pathlib import Path
from typing import Any

import detector_models
import numpy as np
import pytest
from checks import Command, cases, compiled_only, refused
from films import regular, write_at_rate, write_stamped
from recordings import assert_same, track
from scenes import SIZE, body_box, corner_cameras, mask, rig_of

from stseg import Boxes, Recording, Source, detect, read_recording, read_run
from stseg.arrays import Bytes
from stseg.errors import OutputError
from stseg.io.detectors import detected_boxes
from stseg.io.detectors.feature_model import FeatureModel
from stseg.io.detectors.kept_file import KeptFile
from stseg.io.detectors.people_detector import OnnxDetector
from stseg.io.recording.aligned_stream import index_streams
from stseg.io.recording.frames import open_frames
from stseg.io.recording.recording import CameraSource
from stseg.io.recording.rig_text import format_rig
from stseg.io.untrusted import limits

FRAMES = 24
PASSES = FRAMES // detected_boxes._PICTURES
CALLS = 4 * (FRAMES + PASSES)
"""Of models for all pictures of four cameras: boxes of each picture, features of several together."""
COLOURS = ((40, 40, 250), (250, 40, 40), (40, 250, 40))
CAMERAS = corner_cameras()


def standing(frame: float) -> np.ndarray:
    """x, y, height of one person who walks through the room, metres."""
    return np.array([[-1.2 + 0.1 * frame, 0.4, 1.7]])


def meeting(frame: float) -> np.ndarray:
    """Two who pass each other, meet, and turn back, and a third who walks by."""
    x = np.interp(frame, (0, 32, 48, 50, 66, 98), (-1.6, 1.6, 0, 0, 1.6, -1.6))
    return np.array([[x, -0.1, 1.7], [-x, 0.1, 1.7], [0.03 * frame - 1.5, 1.3, 1.7]])


def pictures(k: int, people: Callable[[float], np.ndarray] = standing, frames: int = FRAMES) -> list[Bytes]:
    """People in red, blue and green before a camera, the nearest in front."""
    found = []
    for frame in range(frames):
        image, here = np.full((*SIZE[::-1], 3), 90, np.uint8), people(frame)
        for person in np.argsort(-np.hypot(*(here[:, :2] - CAMERAS[k].centre[:2]).T)):
            image[mask(CAMERAS[k], here[person : person + 1]) > 127] = COLOURS[person]
        found.append(image)
    return found


def write_room(folder: Path, people: Callable[[float], np.ndarray] = standing, frames: int = FRAMES) -> Path:
    """The rig file of four videos of some people, each with a detector and features."""
    model = detector_models.people(folder / "model.onnx", SIZE, len(people(0)))
    features = detector_models.mean_colour(folder / "colour.onnx")
    videos = [write_at_rate(folder / f"corner{k}.avi", pictures(k, people, frames)) for k in range(len(CAMERAS))]
    feeds = [CameraSource(Source("video", video, detector=model, features=features)) for video in videos]
    path = folder / "room.toml"
    path.write_text(format_rig(Recording(path, rig_of(CAMERAS), tuple(feeds)), path))
    return path


@pytest.fixture(scope="module")
def filmed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """That of one person."""
    return write_room(tmp_path_factory.mktemp("filmed"))


@pytest.fixture
def room(filmed: Path, tmp_path: Path) -> Path:
    """A copy of it, to be changed."""
    shutil.copytree(filmed.parent, tmp_path / "room")
    return tmp_path / "room" / filmed.name


@pytest.fixture(scope="module")
def detected(filmed: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The rig file that `stseg detect` writes."""
    return detect(filmed, tmp_path_factory.mktemp("detected") / "boxes").path


class Stop(Exception):
    """Stands for a kill."""


@pytest.fixture
def searched(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[int]]:
    """Counts calls of models in its first number, and stops at the one whose number is the second."""
    count = [0, -1]

    def counting(*given: Any, found: Callable[..., Any]) -> Any:
        if count[0] == count[1]:
            raise Stop
        count[0] += 1
        return found(*given)

    for kind, name in ((OnnxDetector, "detect"), (FeatureModel, "describe")):
        monkeypatch.setattr(kind, name, partialmethod(counting, found=getattr(kind, name)))
    monkeypatch.setattr(detected_boxes, "_KEPT_EVERY", 0.0)
    yield count


@pytest.mark.slow
@compiled_only
def test_features_tell_apart_who_turn_back(stdout: Command, tmp_path: Path) -> None:
    """By their motion they passed each other again; without images beside the boxes features alone know better."""
    room = write_room(tmp_path, meeting, 99)
    assert ", 3 features each" in stdout("detect", room, "-o", tmp_path / "boxes")
    rig = tmp_path / "boxes" / "room.toml"
    rig.write_text(re.sub("^images.*$", "", rig.read_text(), flags=re.MULTILINE))
    for use in "learned", "none":
        assert track(rig, tmp_path / f"{use}.h5", "--set", f"tracking.appearance={use}") == 0
        rows = read_run(tmp_path / f"{use}.h5").trajectory
        x = [{int(row["id"]): row["x"] for row in rows[rows["frame"] == frame] if row["y"] < 1} for frame in (0, 96)]
        assert len(x[0]) == 2 and all((x[0][k] * x[1][k] > 1) == (use == "learned") for k in x[0])


@compiled_only
def test_a_run_makes_the_boxes_that_detect_makes(filmed: Path, detected: Path, tmp_path: Path) -> None:
    assert track(filmed, tmp_path / "one.h5") == 0
    shutil.copy(tmp_path / "one.h5", tmp_path / "old.h5")
    assert track(filmed, tmp_path / "old.h5") == 2 and not (tmp_path / "old.h5.boxes").exists()
    assert track(detected, tmp_path / "other.h5") == 0
    assert_same(tmp_path / "one.h5", tmp_path / "other.h5")
    run = read_run(tmp_path / "one.h5")
    x = np.array([standing(frame)[0, 0] for frame in run.trajectory["frame"]])
    assert len(run.tracks) == 1 and np.abs(run.trajectory["x"] - x).max() < 0.2
    assert {path.name for path in (tmp_path / "one.h5.boxes").iterdir()} == {
        f"{camera.name}.{kind}" for camera in CAMERAS for kind in ("csv", "json", "features.npy", "features.json")
    }
    assert run.recording.sources[0].source.path.samefile(tmp_path / "one.h5.boxes" / "corner0.csv")


@pytest.mark.parametrize("kill", [0, 1, FRAMES - 1, FRAMES + 9, 4 * FRAMES - 1, 4 * FRAMES + 1, CALLS - 1])
def test_killed_detection_goes_on(
    kill: int, room: Path, detected: Path, searched: list[int], stdout: Command, capsys: Any, tmp_path: Path
) -> None:
    searched[1] = kill
    with pytest.raises(Stop):
        stdout("detect", room, "-o", tmp_path / "boxes")
    kept = f"are kept in {tmp_path / 'boxes'}; the same command goes on from there"
    assert (kept in capsys.readouterr().err) == (kill >= detected_boxes._PICTURES)
    before, searched[1] = searched[0], -1
    printed = stdout("detect", room, "-o", tmp_path / "boxes")
    assert searched[0] - before <= CALLS - kill + (2 * detected_boxes._PICTURES if kill < 4 * FRAMES else 0)
    assert f"corner3.csv: {FRAMES} boxes, 1.0 a frame" in printed
    for name in (f"{camera.name}.{kind}" for camera in CAMERAS for kind in ("csv", "features.npy")):
        assert (tmp_path / "boxes" / name).read_bytes() == (detected.parent / name).read_bytes()


def test_boxes_are_made_once(
    room: Path, searched: list[int], stdout: Command, refusal: Command, tmp_path: Path
) -> None:
    folder = tmp_path / "boxes"
    stdout("detect", room, "-o", folder)
    assert searched[0] == CALLS
    assert "found a file that exists" in refusal("detect", room, "-o", folder)
    stdout("detect", room, "-o", folder, "--overwrite")
    (folder / "room.toml").unlink()
    stdout("detect", room, "-o", folder)
    assert searched[0] == CALLS
    for name, calls in ("corner1.csv", FRAMES), ("corner1.features.npy", PASSES):
        searched[0], written = 0, (folder / name).read_bytes()
        (folder / name).write_bytes(written[:-5])  # cut short: made anew
        stdout("detect", room, "-o", folder, "--overwrite")
        assert searched[0] == calls and (folder / name).read_bytes() == written


def test_boxes_of_another_request_are_refused(
    room: Path, searched: list[int], stdout: Command, refusal: Command, tmp_path: Path
) -> None:
    folder = tmp_path / "boxes"
    stdout("detect", room, "-o", folder)
    (folder / "room.toml").unlink()
    other = detector_models.mean_colour(tmp_path / "other.onnx", "n", (0, 3), 0.5)
    options = ("--score 0.9", "csv: score"), ("--class 0", "csv: classes"), ("--model hog", "csv: detector")
    for option, key in (*options, (f"--features {other}", "features.npy: features")):
        message = refusal("detect", room, "-o", folder, *option.split())
        assert f"corner0.{key}: found" in message and "--overwrite" in message
    detector_models.people(room.parent / "model.onnx", (64, 48))
    assert "detector: found 'model.onnx" in refusal("detect", room, "-o", folder)
    write_at_rate(room.parent / "corner2.avi", pictures(2)[::-1])
    detector_models.people(room.parent / "model.onnx", SIZE)
    assert "corner2.csv: video: found" in refusal("detect", room, "-o", folder)
    assert searched[0] == CALLS
    stdout("detect", room, "-o", folder, "--overwrite")
    assert searched[0] == CALLS + FRAMES + PASSES
    stdout("detect", room, "-o", folder, "--overwrite", "--features", other)
    assert searched[0] == CALLS + FRAMES + 5 * PASSES


def test_foreign_files_stay(room: Path, refusal: Command, tmp_path: Path) -> None:
    folder = tmp_path / "boxes"
    folder.mkdir()
    for name in ("corner1.csv", "corner1.csv.unfinished", "corner1.json", "corner1.features.npy"):
        (folder / name).write_text("mine")
        for more in ((), ("--overwrite",)):
            message = refusal("detect", room, "-o", folder, *more)
            assert f"{name}: found a file that stseg did not make" in message
        assert (folder / name).read_text() == "mine"
        (folder / name).unlink()
    notes = json.dumps({"made": "made by stseg", "request": 5, "frames": -1})
    (folder / "corner1.json").write_text(notes)
    assert "stseg did not make" in refusal("detect", room, "-o", folder)


def test_time_stamps_of_the_videos_count(room: Path, stdout: Command, tmp_path: Path) -> None:
    """One camera drops frames: boxes and features are those of the person where the time stamps say."""
    kept = [frame for frame in range(FRAMES) if frame not in (5, 6, 7, 15)]
    film = pictures(1)
    write_stamped(room.parent / "corner1.mkv", [film[k] for k in kept], regular(FRAMES)[kept].tolist())
    room.write_text(room.read_text().replace("corner1.avi", "corner1.mkv"))
    stdout("detect", room, "-o", tmp_path / "boxes")
    recording = read_recording(tmp_path / "boxes" / "room.toml")
    assert [feed.clock for feed in recording.sources] == ["count", "stamps", "count", "count"]
    streams = index_streams(recording)
    assert streams.length == FRAMES
    shown = 0
    with open_frames(recording, streams=streams) as frame_sets:
        for frame_set in frame_sets:
            for camera, view, image in zip(CAMERAS, frame_set.views, frame_set.images, strict=True):
                assert (view is None) == (image is None)
                if isinstance(view, Boxes):
                    left, top, right, bottom = body_box(camera, standing(frame_set.frame)[0]).clip(0, [*SIZE, *SIZE])
                    assert view.pixel.tolist() == [pytest.approx([left, top, right - left, bottom - top], abs=2.5)]
                    assert view.features is not None and view.features[0, 0] > -0.2
                    shown += 1
    assert shown == 4 * FRAMES - 4


@cases()
def test_sources_are_refused(room: Path, refusal: Command, tmp_path: Path, old: str, new: str, match: str) -> None:
    models = 'detector = "model.onnx", features = "colour.onnx"'
    source = f'source = {{ kind = "video", path = "corner1.avi", {models} }}'
    assert old in source and source in room.read_text()
    room.write_text(room.read_text().replace(source, source.replace(old, new)))
    assert re.search(match, refusal("detect", room, "-o", tmp_path / "boxes"))
    assert not (tmp_path / "boxes").exists()


def test_too_many_boxes_and_boxes_alone_are_refused(
    room: Path, stdout: Command, refusal: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(limits, "FEATURES_FILE", 72)
    found = "corner0.features.npy: found 24 boxes, of 3 numbers each, expected at most 12: a greater least score"
    assert found in refusal("detect", room, "-o", tmp_path / "many")
    (room.parent / "boxes.csv").write_text("frame,left,top,width,height\n0,1,1,5,9\n")
    stdout("inspect", room)
    assert re.search("corner0, detector: found a video without its boxes.*stseg detect", refusal("plan", room))
    boxes_alone = replace(read_recording(room), sources=(CameraSource(Source("boxes", room.parent / "boxes.csv")),) * 4)
    room.write_text(format_rig(boxes_alone, room))
    assert re.search("boxes alone, expected a camera that delivers", refusal("detect", room, "-o", tmp_path / "boxes"))


def test_boxes_that_another_run_writes_are_left_alone(tmp_path: Path) -> None:
    first, second = (KeptFile(tmp_path / "corner0.csv", {}, False) for _ in range(2))
    first.begin(b"frame\n", False)
    refused(OutputError, "another run", second.begin, b"frame\n", False)
    first.close()
