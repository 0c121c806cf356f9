"""Boxes from videos: `stseg detect`, and runs whose rig names a detector."""

import json
import re
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import detector_models
import numpy as np
import pytest
from checks import Command, cases, compiled_only
from films import regular, write_at_rate, write_stamped
from recordings import assert_same, track
from scenes import SIZE, body_box, corner_cameras, mask, rig_of

from stseg import Boxes, Recording, Source, detect, read_recording, read_run
from stseg.arrays import Bytes
from stseg.io.detectors import detected_boxes
from stseg.io.detectors.people_detector import OnnxDetector
from stseg.io.recording.aligned_stream import index_streams
from stseg.io.recording.frames import open_frames
from stseg.io.recording.recording import CameraSource
from stseg.io.recording.rig_text import format_rig
from stseg.io.recording.streams import open_boxes

FRAMES = 24
CAMERAS = corner_cameras()


def standing(frame: float) -> np.ndarray:
    """x, y, height of one person who walks through the room, metres."""
    return np.array([[-1.2 + 0.1 * frame, 0.4, 1.7]])


def pictures(k: int) -> list[Bytes]:
    """The person in red before a camera."""
    found = []
    for frame in range(FRAMES):
        image = np.full((*SIZE[::-1], 3), 90, np.uint8)
        image[mask(CAMERAS[k], standing(frame)) > 127] = (40, 40, 250)
        found.append(image)
    return found


@pytest.fixture(scope="module")
def filmed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The rig file of four videos, each with a detector."""
    folder = tmp_path_factory.mktemp("filmed")
    model = detector_models.one_person(folder / "model.onnx", SIZE)
    sources = [
        Source("video", write_at_rate(folder / f"{camera.name}.avi", pictures(k)), detector=model)
        for k, camera in enumerate(CAMERAS)
    ]
    path = folder / "room.toml"
    path.write_text(format_rig(Recording(path, rig_of(CAMERAS), tuple(map(CameraSource, sources))), path))
    return path


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
    """Counts pictures in its first number, and stops at the one whose number is the second."""
    count, found = [0, -1], OnnxDetector.detect

    def counting(detector: OnnxDetector, picture: Bytes) -> Boxes:
        if count[0] == count[1]:
            raise Stop
        count[0] += 1
        return found(detector, picture)

    monkeypatch.setattr(OnnxDetector, "detect", counting)
    monkeypatch.setattr(detected_boxes, "_KEPT_EVERY", 0.0)
    yield count


def test_boxes_are_those_of_the_person(detected: Path) -> None:
    recording = read_recording(detected)
    for camera, feed in zip(recording.rig.cameras, recording.sources, strict=True):
        assert (feed.source.kind, feed.source.frames, feed.source.path.parent) == ("boxes", FRAMES, detected.parent)
        assert feed.images is not None and feed.images.kind == "video"
        boxes = open_boxes(feed.source, camera)
        for frame in range(FRAMES):
            found = boxes.read()
            assert isinstance(found, Boxes) and len(found) == 1
            left, top, right, bottom = body_box(camera, standing(frame)[0]).clip(0, [*SIZE, *SIZE])
            expected = pytest.approx([left, top, right - left, bottom - top], abs=2.5)
            assert found.pixel[0].tolist() == expected


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
        f"{camera.name}.{kind}" for camera in CAMERAS for kind in ("csv", "json")
    }
    assert run.recording.sources[0].source.path.samefile(tmp_path / "one.h5.boxes" / "corner0.csv")


@pytest.mark.parametrize("kill", [0, 1, FRAMES - 1, FRAMES + 9, 4 * FRAMES - 1])
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
    assert searched[0] - before <= 4 * FRAMES - kill + 2 * detected_boxes._PICTURES
    assert f"corner3.csv: {FRAMES} boxes, 1.0 a frame" in printed
    for camera in CAMERAS:
        assert (tmp_path / "boxes" / f"{camera.name}.csv").read_bytes() == (
            detected.parent / f"{camera.name}.csv"
        ).read_bytes()


def test_boxes_are_made_once(
    room: Path, searched: list[int], stdout: Command, refusal: Command, tmp_path: Path
) -> None:
    folder = tmp_path / "boxes"
    stdout("detect", room, "-o", folder)
    assert searched[0] == 4 * FRAMES
    assert "found a file that exists" in refusal("detect", room, "-o", folder)
    stdout("detect", room, "-o", folder, "--overwrite")
    (folder / "room.toml").unlink()
    stdout("detect", room, "-o", folder)
    assert searched[0] == 4 * FRAMES
    written = (folder / "corner1.csv").read_text()
    (folder / "corner1.csv").write_text(written[:-5])  # cut short: made anew
    stdout("detect", room, "-o", folder, "--overwrite")
    assert searched[0] == 5 * FRAMES and (folder / "corner1.csv").read_text() == written


def test_boxes_of_another_request_are_refused(
    room: Path, searched: list[int], stdout: Command, refusal: Command, tmp_path: Path
) -> None:
    folder = tmp_path / "boxes"
    stdout("detect", room, "-o", folder)
    (folder / "room.toml").unlink()
    for option, key in ((("--score", "0.9"), "score"), (("--class", "0"), "classes"), (("--model", "hog"), "detector")):
        message = refusal("detect", room, "-o", folder, *option)
        assert f"corner0.csv: {key}: found" in message and "--overwrite" in message
    detector_models.one_person(room.parent / "model.onnx", (64, 48))
    assert "detector: found 'model.onnx" in refusal("detect", room, "-o", folder)
    write_at_rate(room.parent / "corner2.avi", pictures(2)[::-1])
    detector_models.one_person(room.parent / "model.onnx", SIZE)
    assert "corner2.csv: video: found" in refusal("detect", room, "-o", folder)
    assert searched[0] == 4 * FRAMES
    stdout("detect", room, "-o", folder, "--overwrite")
    assert searched[0] == 5 * FRAMES


def test_foreign_files_stay(room: Path, refusal: Command, tmp_path: Path) -> None:
    folder = tmp_path / "boxes"
    folder.mkdir()
    for name in ("corner1.csv", "corner1.csv.unfinished", "corner1.json"):
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
    """One camera drops frames: its boxes are where its time stamps say."""
    kept = [frame for frame in range(FRAMES) if frame not in (5, 6, 7, 15)]
    film = pictures(1)
    write_stamped(room.parent / "corner1.mkv", [film[k] for k in kept], regular(FRAMES)[kept].tolist())
    room.write_text(room.read_text().replace("corner1.avi", "corner1.mkv"))
    stdout("detect", room, "-o", tmp_path / "boxes")
    recording = read_recording(tmp_path / "boxes" / "room.toml")
    assert [feed.clock for feed in recording.sources] == ["count", "stamps", "count", "count"]
    streams = index_streams(recording)
    assert streams.length == FRAMES
    with open_frames(recording, streams=streams) as frame_sets:
        for frame_set in frame_sets:
            view, image = frame_set.views[1], frame_set.images[1]
            assert (view is None) == (image is None)
            if isinstance(view, Boxes):
                shown = body_box(CAMERAS[1], standing(frame_set.frame)[0])
                assert view.pixel[0, 0] == pytest.approx(shown[0].clip(0), abs=4)


@cases()
def test_sources_are_refused(room: Path, refusal: Command, tmp_path: Path, old: str, new: str, match: str) -> None:
    source = 'source = { kind = "video", path = "corner1.avi", detector = "model.onnx" }'
    assert old in source and source in room.read_text()
    room.write_text(room.read_text().replace(source, source.replace(old, new)))
    assert re.search(match, refusal("detect", room, "-o", tmp_path / "boxes"))
    assert not (tmp_path / "boxes").exists()


def test_boxes_alone_are_refused(room: Path, stdout: Command, refusal: Command, tmp_path: Path) -> None:
    (room.parent / "boxes.csv").write_text("frame,left,top,width,height\n0,1,1,5,9\n")
    stdout("inspect", room)
    assert re.search("corner0, detector: found a video without its boxes.*stseg detect", refusal("plan", room))
    boxes_alone = replace(read_recording(room), sources=(CameraSource(Source("boxes", room.parent / "boxes.csv")),) * 4)
    room.write_text(format_rig(boxes_alone, room))
    assert re.search("boxes alone, expected a camera that delivers", refusal("detect", room, "-o", tmp_path / "boxes"))
