"""Detections as detectors and annotation tools write them: each format is recognised, and its malformed twin named."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from attacks import write_rig
from cases import cases
from refusals import refused

from stseg.commands.inspect import inspect
from stseg.errors import FormatError, InputError, RigError, SourceError
from stseg.geometry import Camera
from stseg.io.detections.masks import run_lengths
from stseg.io.detections.record import listed_frames
from stseg.io.detections.source_detections import read_source
from stseg.io.recording.recording import Source
from stseg.io.recording.rigs import read_recording
from stseg.io.recording.streams import open_stream

SIZE = (80, 60)
BOXES = {0: [(10.0, 12.0, 20.0, 30.0, 0.9)], 2: [(5.0, 6.0, 10.0, 24.0, 0.5), (40.0, 8.0, 16.0, 40.0, 0.25)]}
"""By frame: left, top, width, height, score."""
SAMPLES = Path(__file__).parent / "detections"
"""A folder a format, with the boxes as its program writes them."""
FORMATS: dict[str, tuple[str, dict[str, Any]]] = {
    "Ultralytics text": ("labels", {"first_frame": 1, "classes": ("person",)}),
    "Ultralytics JSON": ("r.jsonl", {}),
    "COCO results": ("results.json", {"select": "cam1/*", "classes": ("Person",)}),
    "COCO data set": ("data.json", {"select": "cam1/*"}),
    "MMDetection": ("preds", {"classes": ("0",)}),
    "CSV": ("own.csv", {"columns": (("frame", "Bild"), ("x", "mx"), ("y", "my"), ("score", "p"))}),
    "CSV with corners": ("own.csv", {"classes": ("person",)}),
    "Parquet": ("b.parquet", {}),
    "CSV of supervision": ("sink.csv", {"classes": ("person",)}),
    "JSON table of supervision": ("sink.json", {"classes": ("person",)}),
    "WILDTRACK": ("annotations_positions", {"view": 1}),
    "MOTChallenge truth": ("gt.txt", {"first_frame": 1}),
    "CVAT XML": ("video.xml", {"classes": ("person",)}),
    "Label Studio": ("studio.json", {}),
    "VIA": ("via.json", {"classes": ("person",)}),
}
"""The file or folder of each, and the keys of its source."""
ANNOTATED = ("WILDTRACK", "MOTChallenge truth", "CVAT XML", "Label Studio", "VIA")
"""Formats without scores."""


def sample(folder: Path, name: str) -> Source:
    """A copy of a format's files, and their source."""
    if name == "Parquet":
        pytest.importorskip("pyarrow")
    shutil.copytree(SAMPLES / name.lower().replace(" ", "_"), folder, dirs_exist_ok=True)
    (file, keys), images = FORMATS[name], folder / "images.json"
    return Source("boxes", folder / file, **keys, image_list=images if images.exists() else None)


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_gives_the_same_boxes(tmp_path: Path, name: str) -> None:
    found = read_source(sample(tmp_path, name), SIZE)
    assert name.startswith(found.format)
    assert found.frames == 3
    for frame in range(3):
        boxes, own = found.table.at(frame), BOXES.get(frame, [])
        np.testing.assert_allclose(boxes.pixel.reshape(-1, 4), np.array([b[:4] for b in own]).reshape(-1, 4), atol=1e-6)
        scores = [1.0 if name in ANNOTATED else b[4] for b in own]
        np.testing.assert_allclose(boxes.score, scores)


@cases()
def test_a_malformed_twin_is_one_line(tmp_path: Path, name: str, file: str, old: str, new: str, message: str) -> None:
    made = sample(tmp_path, name)
    path = tmp_path / file
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    assert "\n" not in refused(InputError, message, read_source, made, SIZE)


STUDIO = {"type": "videorectangle", "value": {"sequence": []}}
NAMES = ("cam1/0.png", "cam1/1.png", "cam2/0.png", "cam2/1.png")


@cases()
def test_annotations_of_other_cameras_sizes_and_shapes(
    tmp_path: Path, file: str, content: object, message: str
) -> None:
    text = f"<annotations>{content}</annotations>" if file == "a.xml" else json.dumps(content)
    (tmp_path / file).write_text(text)
    refused(InputError, message, read_source, Source("boxes", tmp_path / file), SIZE)


@cases(("width", None, r"header: found the columns frame, left, top, height, score"))
def test_a_malformed_table_of_parquet_is_one_line(
    tmp_path: Path, column: str, values: list[object] | None, message: str
) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet as writer

    columns = {"frame": [0, 1], "left": [1, 1], "top": [2, 2], "width": [4, 4], "height": [3, 3], "score": [0.5, 0.5]}
    chosen = {name: values if name == column else own for name, own in columns.items()}
    table = {name: own for name, own in chosen.items() if own is not None}
    writer.write_table(pyarrow.table(table), tmp_path / "b.parquet")
    assert "\n" not in refused(InputError, message, read_source, Source("boxes", tmp_path / "b.parquet"), SIZE)


def test_broken_parquet_is_named(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    (tmp_path / "b.parquet").write_bytes(b"no")
    refused(FormatError, "no Parquet", read_source, Source("boxes", tmp_path / "b.parquet"), SIZE)


def test_classes_and_scores_choose(tmp_path: Path) -> None:
    made = sample(tmp_path, "Ultralytics text")
    both = read_source(Source("boxes", made.path, 1), SIZE)
    assert both.read.classes() == {"person": 3, "car": 2}
    assert len(read_source(Source("boxes", made.path, 1, classes=("car",)), SIZE).kept) == 2
    assert len(read_source(Source("boxes", made.path, 1, least_score=0.6), SIZE).kept) == 3
    said = r"no detections of persn; classes are person \(3\), car \(2\)"
    refused(SourceError, said, read_source, Source("boxes", made.path, 1, classes=("persn",)), SIZE)


def test_ground_truth_of_motchallenge_keeps_its_flag_and_classes(tmp_path: Path) -> None:
    path = tmp_path / "gt.txt"
    path.write_text("1,1,10,12,20,30,1,1,0.8\n1,2,1,1,5,5,0,1,1\n3,1,5,6,10,24,1,3,1\n")
    found = read_source(Source("boxes", path, 1), SIZE)
    assert found.format == "MOTChallenge truth" and found.read.classes() == {"car": 1, "pedestrian": 1}
    assert len(read_source(Source("boxes", path, 1, classes=("pedestrian",)), SIZE).kept) == 1


def test_track_ids_are_no_scores_and_keypoints_no_outlines(tmp_path: Path) -> None:
    (tmp_path / "v_0.txt").write_text("0 0.5 0.5 0.1 0.2 1\n0 0.2 0.5 0.1 0.2 2\n")
    assert read_source(Source("boxes", tmp_path), SIZE).kept.score.tolist() == [1, 1]
    (tmp_path / "v_0.txt").write_text(f"0 0.5 0.5 0.1 0.2 {'0.3 0.4 0.9 ' * 17} 0.75\n")
    found = read_source(Source("boxes", tmp_path), SIZE)
    assert found.kept.score.tolist() == [0.75] and not found.kept.mask


def test_run_lengths_are_cocos() -> None:
    """The text is that of pycocotools 2.0 for the mask below."""
    mask = np.zeros((6, 8), np.uint8)
    mask[1:4, 2:6] = 1
    mask[4, 3] = 1
    np.testing.assert_array_equal(run_lengths([6, 8], "=331OO10;").draw((8, 6)), mask)
    np.testing.assert_array_equal(run_lengths([6, 8], [13, 3, 3, 4, 2, 3, 3, 3, 14]).draw((8, 6)), mask)


def test_masks_become_instances(tmp_path: Path) -> None:
    camera = Camera.from_projection("a", SIZE, np.array([[50.0, 0, 0, 0], [0, -50, 0, 0], [0, 0, -1, 5]]))
    rows = json.loads((SAMPLES / "coco_results" / "results.json").read_text())
    rows[0]["segmentation"] = [[10, 12, 30, 12, 30, 42, 10, 42]]
    rows[1]["segmentation"] = {"size": [60, 80], "counts": [0, 60, 4740]}
    rows[2]["segmentation"] = [[0, 0, 3, 0, 3, 59, 0, 59]]
    (tmp_path / "r.json").write_text(json.dumps(rows))
    stream = open_stream(Source("instances", tmp_path / "r.json", 7), camera)
    first, empty, third, end = (stream.read() for _ in range(4))
    assert isinstance(first, np.ndarray) and first.dtype == np.uint16 and first[20, 20] == 1 and first[50, 50] == 0
    assert isinstance(empty, np.ndarray) and not empty.any()
    assert isinstance(third, np.ndarray) and third[30, 0] == 2 and third[30, 2] == 1, "the better score is on top"
    assert end is None


def test_images_at_equal_steps_are_consecutive_frames() -> None:
    assert listed_frames(Path("a"), ["a_10.png", "a_20.png", "a_0.png"])[0].tolist() == [1, 2, 0]
    numbers, count = listed_frames(Path("a"), ["a_10.png", "a_20.png", "a_90.png"])
    assert numbers.tolist() == [10, 20, 90] and count is None
    frames, count = listed_frames(Path("a"), ["x", "y"])
    assert frames.tolist() == [0, 1] and count == 2


def test_the_rig_names_a_wrong_key(tmp_path: Path) -> None:
    old, new = '"boxes.csv" }', '"x.json", SOURCE }\nimages = { kind = "video", path = "x.mp4" }'
    keys = 'classes = ["person"], score = 0.3, columns = { frame = "t" }'
    path = write_rig(tmp_path, old, new.replace("SOURCE", keys))
    (own,) = read_recording(path).sources
    assert own.source.classes == ("person",) and own.source.least_score == 0.3 and own.images is not None
    assert read_recording(path).pictured().sources[0].source.kind == "video"
    for wrong, message in (("score = 3", "a number from 0 to 1"), ('columns = { frme = "t" }', "did you mean frame")):
        refused(RigError, message, read_recording, write_rig(tmp_path, old, new.replace("SOURCE", wrong)))


def test_inspect_says_what_a_rig_delivers_and_draws_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    sample(tmp_path, "Ultralytics text")
    rig = write_rig(tmp_path, '"boxes.csv"', '"labels"')
    inspect(rig, output=tmp_path / "pictures")
    printed = capsys.readouterr().out
    assert "Ultralytics text" in printed and "person 3, car 2" in printed
    assert "do its frames count from 1? (first_frame = 1)" in printed
    assert (tmp_path / "pictures" / "cam1.png").stat().st_size > 1000
    (tmp_path / "labels" / "walk_1.txt").write_text("0 0.5\n")
    refused(FormatError, r"walk_1\.txt, line 1", inspect, rig)
