"""Detections as detectors and annotation tools write them: each format is recognised, and its malformed twin named."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refusals import refused

from stseg.errors import FormatError, InputError, RigError, SourceError
from stseg.io.detections.masks import flat_polygons, run_lengths
from stseg.io.detections.record import listed_frames
from stseg.io.detections.source_detections import read_source
from stseg.io.recording.recording import Source
from stseg.io.recording.streams import open_stream

SIZE = (80, 60)
BOXES = {0: [(10.0, 12.0, 20.0, 30.0, 0.9)], 2: [(5.0, 6.0, 10.0, 24.0, 0.5), (40.0, 8.0, 16.0, 40.0, 0.25)]}
"""By frame: left, top, width, height, score."""
RIG = """format = 1
[scene]
name = "s"
frame_rate = 5.0
x = [-1.0, 1.0]
y = [-1.0, 1.0]
[grid]
cell = 0.1
top = 1.8
planes = 3
[[camera]]
name = "a"
size = [80, 60]
projection = [[40.0, 0, -39.5, 200], [0, -40.0, -29.5, 150], [0, 0, -1.0, 5]]
source = { kind = "boxes", path = "PATH" }
"""
Writer = Callable[[Path], Source]


def source(path: Path, **more: Any) -> Source:
    return Source("boxes", path, **more)


def corners(box: tuple[float, ...]) -> list[float]:
    return [box[0], box[1], box[0] + box[2], box[1] + box[3]]


def dump(path: Path, data: Any) -> Path:
    path.write_text(json.dumps(data))
    return path


def yolo_text(folder: Path) -> Source:
    (folder / "labels").mkdir()
    (folder / "classes.txt").write_text("person\ncar\n")
    for frame, boxes in BOXES.items():
        lines = [f"0 {(x + w / 2) / 80} {(y + h / 2) / 60} {w / 80} {h / 60} {score}\n" for x, y, w, h, score in boxes]
        (folder / f"labels/walk_{frame + 1}.txt").write_text("".join(lines) + "1 0.5 0.5 0.1 0.1 0.9\n")
    return source(folder / "labels", first_frame=1, classes=("person",))


def yolo_json(folder: Path) -> Source:
    keys = ("x1", "y1", "x2", "y2")
    frames = [
        [{"name": "person", "class": 0, "confidence": b[4], "box": dict(zip(keys, corners(b), strict=True))}
         for b in BOXES.get(frame, [])]
        for frame in range(3)
    ]  # fmt: skip
    (folder / "r.jsonl").write_text("\n".join(map(json.dumps, frames)))
    return source(folder / "r.jsonl")


def coco_rows() -> list[dict[str, Any]]:
    return [
        {"image_id": 7 + frame, "category_id": 1, "bbox": list(box[:4]), "score": box[4]}
        for frame, boxes in BOXES.items()
        for box in boxes
    ]


def coco_images() -> dict[str, Any]:
    images = [{"id": 7 + frame, "file_name": f"cam1/{10 * frame:06d}.jpg"} for frame in range(3)]
    other = [{"id": 90, "file_name": "cam2/000000.jpg"}]
    return {"images": images + other, "annotations": [], "categories": [{"id": 1, "name": "person"}]}


def coco_results(folder: Path) -> Source:
    images = dump(folder / "images.json", coco_images())
    path = dump(folder / "results.json", coco_rows())
    return source(path, image_list=images, select="cam1/*", classes=("Person",))


def coco_dataset(folder: Path) -> Source:
    return source(dump(folder / "data.json", coco_images() | {"annotations": coco_rows()}), select="cam1/*")


def mmdetection(folder: Path) -> Source:
    (folder / "preds").mkdir()
    for frame in range(3):
        boxes = BOXES.get(frame, [])
        own = {"labels": [0] * len(boxes), "scores": [b[4] for b in boxes], "bboxes": [corners(b) for b in boxes]}
        dump(folder / f"preds/{frame:06d}.json", own)
    return source(folder / "preds", classes=("0",))


def wildtrack(folder: Path) -> Source:
    (folder / "annotations_positions").mkdir()
    for frame in range(3):
        people = []
        for k, box in enumerate(BOXES.get(frame, [])):
            x0, y0, x1, y1 = (int(value) for value in corners(box))
            shown = {"viewNum": 1, "xmin": x0, "ymin": y0, "xmax": x1, "ymax": y1}
            hidden = {"viewNum": 0, "xmin": -1, "ymin": -1, "xmax": -1, "ymax": -1}
            people.append({"personID": k, "positionID": 5, "views": [hidden, shown]})
        dump(folder / f"annotations_positions/{5 * frame:08d}.json", people)
    return source(folder / "annotations_positions", view=1)


def cvat(folder: Path) -> Source:
    tracks = [
        f'<track id="{frame}{k}" label="person">'
        f'<box frame="{frame}" outside="0" xtl="{b[0]}" ytl="{b[1]}" xbr="{b[0] + b[2]}" ybr="{b[1] + b[3]}"/>'
        f'<box frame="{frame + 1}" outside="1" xtl="0" ytl="0" xbr="1" ybr="1"/></track>'
        for frame, boxes in BOXES.items()
        for k, b in enumerate(boxes)
    ]
    text = f"<annotations><meta><job><size>3</size></job></meta>{''.join(tracks)}</annotations>"
    (folder / "video.xml").write_text(text)
    return source(folder / "video.xml", classes=("person",))


def motchallenge_truth(folder: Path) -> Source:
    boxes = [(frame + 1, *box[:4]) for frame, own in BOXES.items() for box in own]
    rows = [f"{frame},0,{left},{top},{width},{height},1,1,0.8\n" for frame, left, top, width, height in boxes]
    (folder / "gt.txt").write_text("".join(rows) + "2,9,1,1,5,5,0,1,1\n")
    return source(folder / "gt.txt", first_frame=1)


def label_studio(folder: Path) -> Source:
    def result(box: tuple[float, ...]) -> dict[str, Any]:
        x, y, w, h = box[0] / 0.8, box[1] / 0.6, box[2] / 0.8, box[3] / 0.6
        value = {"x": x, "y": y, "width": w, "height": h, "rectanglelabels": ["person"]}
        return {"type": "rectanglelabels", "value": value}

    tasks = [
        {"data": {"image": f"/upload/{frame:04d}.png"},
         "annotations": [{"result": [result(box) for box in BOXES.get(frame, [])]}]}
        for frame in range(3)
    ]  # fmt: skip
    return source(dump(folder / "studio.json", tasks))


def via(folder: Path) -> Source:
    def region(box: tuple[float, ...]) -> dict[str, Any]:
        shape = {"name": "rect", "x": box[0], "y": box[1], "width": box[2], "height": box[3]}
        return {"shape_attributes": shape, "region_attributes": {"kind": "person"}}

    images = {
        f"f{frame}.jpg1": {"filename": f"f{frame}.jpg", "size": 1, "regions": [region(b) for b in BOXES.get(frame, [])]}
        for frame in range(3)
    }
    return source(dump(folder / "via.json", {"_via_img_metadata": images}), classes=("person",))


def csv_mapped(folder: Path) -> Source:
    rows = [
        f"{frame},{b[0] + b[2] / 2},{b[1] + b[3] / 2},{b[2]},{b[3]},{b[4]}" for frame in BOXES for b in BOXES[frame]
    ]
    (folder / "own.csv").write_text("\n".join(["Bild,mx,my,w,h,p", *rows]))
    return source(folder / "own.csv", columns=(("frame", "Bild"), ("x", "mx"), ("y", "my"), ("score", "p")))


def csv_corners(folder: Path) -> Source:
    rows = [f"{frame},{','.join(map(str, corners(b)))},{b[4]},person" for frame in BOXES for b in BOXES[frame]]
    (folder / "own.csv").write_text("\n".join(["frame_id,xmin,ymin,xmax,ymax,confidence,label", *rows]))
    return source(folder / "own.csv", classes=("person",))


def parquet(folder: Path) -> Source:
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet as writer

    rows = [(frame, *b) for frame in BOXES for b in BOXES[frame]]
    names = ("frame", "left", "top", "width", "height", "score")
    writer.write_table(
        pyarrow.table(dict(zip(names, map(list, zip(*rows, strict=True)), strict=True))), folder / "b.parquet"
    )
    return source(folder / "b.parquet")


SCORED: dict[str, Writer] = {
    "Ultralytics text": yolo_text,
    "Ultralytics JSON": yolo_json,
    "COCO results": coco_results,
    "COCO data set": coco_dataset,
    "MMDetection": mmdetection,
    "CSV": csv_mapped,
    "CSV with corners": csv_corners,
    "Parquet": parquet,
}
ANNOTATED: dict[str, Writer] = {
    "WILDTRACK": wildtrack,
    "MOTChallenge truth": motchallenge_truth,
    "CVAT XML": cvat,
    "Label Studio": label_studio,
    "VIA": via,
}


@pytest.mark.parametrize("name", [*SCORED, *ANNOTATED])
def test_every_format_gives_the_same_boxes(tmp_path: Path, name: str) -> None:
    found = read_source((SCORED | ANNOTATED)[name](tmp_path), SIZE)
    assert name.startswith(found.format)
    assert found.frames == 3
    for frame in range(3):
        boxes, own = found.table.at(frame), BOXES.get(frame, [])
        np.testing.assert_allclose(boxes.pixel.reshape(-1, 4), np.array([b[:4] for b in own]).reshape(-1, 4), atol=1e-6)
        scores = [b[4] if name in SCORED else 1.0 for b in own]
        np.testing.assert_allclose(boxes.score, scores)


@pytest.mark.parametrize(
    ("name", "file", "old", "new", "message"),
    [
        ("Ultralytics text", "labels/walk_3.txt", "0.5\n", "x\n", r"walk_3.txt, line 1: found field 'x'"),
        ("Ultralytics text", "labels/walk_1.txt", "1 0.5 0.5", "1 0.5 300", r"found 300, expected shares of"),
        ("Ultralytics JSON", "r.jsonl", '"x2": 30.0, ', "", r"frame 0, detection 0: found no x2"),
        ("COCO results", "results.json", '"image_id": 7', '"image_id": 700', r"detection 0: found image_id 700"),
        ("COCO data set", "data.json", "12.0, 20.0, 30.0]", "12.0, 20.0]", r"detection 0: found a box of 3 numbers"),
        ("MMDetection", "preds/000002.json", "[0, 0]", "[0]", r"frame 2: found bboxes, scores, labels and masks"),
        ("WILDTRACK", "annotations_positions/00000000.json", '"ymax": 42', '"ymax": "a"', r"person 0: found box 'a'"),
        ("MOTChallenge truth", "gt.txt", "16.0,40.0,1,1,0.8", "16.0,40.0", r"line 3: found 6 fields, expected 9"),
        ("MOTChallenge truth", "gt.txt", "10.0,24.0", "10.0,tall", r"line 2: found field 'tall'"),
        ("MOTChallenge truth", "gt.txt", "3,0,5.0", "3.5,0,5.0", r"line 2: found frame 3.5, expected a whole"),
        ("MOTChallenge truth", "gt.txt", "30.0,1,1,", "30.0,1,1.5,", r"line 1: found class 1.5, expected a whole"),
        ("MOTChallenge truth", "gt.txt", "1,0,10.0", "0,0,10.0", r"found frame 0, expected a frame from first_frame"),
        ("CVAT XML", "video.xml", 'xtl="10.0"', "", r"track 00, frame 0: found box ''"),
        ("CVAT XML", "video.xml", "</annotations>", "", r"video.xml: found what is not XML"),
        ("Label Studio", "studio.json", '"width": 25.0, ', "", r"task 0, result 0: found no width"),
        ("VIA", "via.json", '"width": 20.0, ', "", r"f0.jpg, region 0: found no width"),
        ("CSV", "own.csv", "0.9", "1.9", r"line 2: found score 1.9"),
        ("CSV", "own.csv", "Bild", "Frame", r"columns.frame: found no column Bild"),
        ("CSV with corners", "own.csv", "xmax", "far", r"header: found the columns frame_id, xmin, ymin, far"),
        ("CSV with corners", "own.csv", "0,10.0,12.0", "0,10.0", r"line 2: found 6 fields"),
        ("CSV with corners", "own.csv", "0,10.0,12.0", "0.5,10.0,12.0", r"line 2: found frame 0.5, expected a whole"),
    ],
)  # fmt: skip
def test_a_malformed_twin_is_one_line(tmp_path: Path, name: str, file: str, old: str, new: str, message: str) -> None:
    made = (SCORED | ANNOTATED)[name](tmp_path)
    path = tmp_path / file
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    assert "\n" not in refused(InputError, message, read_source, made, SIZE)


@pytest.mark.parametrize(
    ("column", "values", "message"),
    [
        ("score", [0.9, 1.9], r"row 1: found score 1.9"),
        ("frame", [0.0, 0.5], r"row 1: found frame 0.5, expected a whole"),
        ("left", ["1", "far"], r"row 1: found left 'far'"),
        ("height", [3.0, -3.0], r"row 1: found a box 4 by -3 pixels"),
        ("width", None, r"header: found the columns frame, left, top, height, score"),
    ],
)
def test_a_malformed_table_of_parquet_is_one_line(
    tmp_path: Path, column: str, values: list[object] | None, message: str
) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet as writer

    columns = {"frame": [0, 1], "left": [1, 1], "top": [2, 2], "width": [4, 4], "height": [3, 3], "score": [0.5, 0.5]}
    chosen = {name: values if name == column else own for name, own in columns.items()}
    table = {name: own for name, own in chosen.items() if own is not None}
    writer.write_table(pyarrow.table(table), tmp_path / "b.parquet")
    assert "\n" not in refused(InputError, message, read_source, source(tmp_path / "b.parquet"), SIZE)


def test_broken_parquet_and_unknown_json_are_named(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    (tmp_path / "b.parquet").write_bytes(b"no")
    refused(FormatError, "no Parquet", read_source, source(tmp_path / "b.parquet"), SIZE)
    with pytest.raises(FormatError, match="of no known detections, expected one of Ultralytics text, WILDTRACK"):
        read_source(source(dump(tmp_path / "x.json", {"a": 1})), SIZE)
    (tmp_path / "y.json").write_text("{\n no json")
    refused(FormatError, r"y.json: line 2: found no JSON", read_source, source(tmp_path / "y.json"), SIZE)


def test_classes_and_scores_choose(tmp_path: Path) -> None:
    made = yolo_text(tmp_path)
    both = read_source(Source("boxes", made.path, 1), SIZE)
    assert both.read.classes() == {"person": 3, "car": 2}
    assert len(read_source(Source("boxes", made.path, 1, classes=("car",)), SIZE).kept) == 2
    assert len(read_source(Source("boxes", made.path, 1, least_score=0.6), SIZE).kept) == 3
    with pytest.raises(SourceError, match=r"no detections of persn; classes are person \(3\), car \(2\)"):
        read_source(Source("boxes", made.path, 1, classes=("persn",)), SIZE)


def test_ground_truth_of_motchallenge_keeps_its_flag_and_classes(tmp_path: Path) -> None:
    path = tmp_path / "gt.txt"
    path.write_text("1,1,10,12,20,30,1,1,0.8\n1,2,1,1,5,5,0,1,1\n3,1,5,6,10,24,1,3,1\n")
    found = read_source(Source("boxes", path, 1), SIZE)
    assert found.format == "MOTChallenge truth" and found.read.classes() == {"car": 1, "pedestrian": 1}
    assert len(read_source(Source("boxes", path, 1, classes=("pedestrian",)), SIZE).kept) == 1


def test_track_ids_are_no_scores_and_keypoints_no_outlines(tmp_path: Path) -> None:
    (tmp_path / "v_0.txt").write_text("0 0.5 0.5 0.1 0.2 1\n0 0.2 0.5 0.1 0.2 2\n")
    assert read_source(source(tmp_path), SIZE).kept.score.tolist() == [1, 1]
    (tmp_path / "v_0.txt").write_text(f"0 0.5 0.5 0.1 0.2 {'0.3 0.4 0.9 ' * 17} 0.75\n")
    found = read_source(source(tmp_path), SIZE)
    assert found.kept.score.tolist() == [0.75] and not found.kept.mask


def test_run_lengths_are_cocos() -> None:
    """The text is that of pycocotools 2.0 for the mask below."""
    mask = np.zeros((6, 8), np.uint8)
    mask[1:4, 2:6] = 1
    mask[4, 3] = 1
    np.testing.assert_array_equal(run_lengths([6, 8], "=331OO10;").draw((8, 6)), mask)
    np.testing.assert_array_equal(run_lengths([6, 8], [13, 3, 3, 4, 2, 3, 3, 3, 14]).draw((8, 6)), mask)
    refused(ValueError, "for an image of 8 x 7", run_lengths, [7, 8], "=331OO10;")


def test_masks_become_instances(tmp_path: Path, camera: Any) -> None:
    rows = coco_rows()
    rows[0]["segmentation"] = [[10, 12, 30, 12, 30, 42, 10, 42]]
    rows[1]["segmentation"] = {"size": [60, 80], "counts": [0, 60, 4740]}
    rows[2]["segmentation"] = [[0, 0, 3, 0, 3, 59, 0, 59]]
    path = dump(tmp_path / "r.json", rows)
    stream = open_stream(Source("instances", path, 7), camera)
    first, empty, third, end = (stream.read() for _ in range(4))
    assert isinstance(first, np.ndarray) and first.dtype == np.uint16 and first[20, 20] == 1 and first[50, 50] == 0
    assert isinstance(empty, np.ndarray) and not empty.any()
    assert isinstance(third, np.ndarray) and third[30, 0] == 2 and third[30, 2] == 1, "the better score is on top"
    assert end is None


@pytest.fixture
def camera() -> Any:
    from stseg.geometry import Camera

    return Camera.from_projection("a", SIZE, np.array([[50.0, 0, 0, 0], [0, -50, 0, 0], [0, 0, -1, 5]]))


def test_polygons_need_three_points() -> None:
    refused(ValueError, "fewer than 3 points", flat_polygons, [[0, 0, 1, 1]])


def test_images_at_equal_steps_are_consecutive_frames() -> None:
    assert listed_frames(["a_10.png", "a_20.png", "a_0.png"])[0].tolist() == [1, 2, 0]
    numbers, count = listed_frames(["a_10.png", "a_20.png", "a_90.png"])
    assert numbers.tolist() == [10, 20, 90] and count is None
    frames, count = listed_frames(["x", "y"])
    assert frames.tolist() == [0, 1] and count == 2


def test_the_rig_names_a_wrong_key(tmp_path: Path) -> None:
    from stseg.io.recording.rigs import read_recording

    text = RIG.replace('"PATH"', '"x.json", SOURCE') + 'images = { kind = "video", path = "x.mp4" }\n'
    path = tmp_path / "rig.toml"
    path.write_text(text.replace("SOURCE", 'classes = ["person"], score = 0.3, columns = { frame = "t" }'))
    (own,) = read_recording(path).sources
    assert own.source.classes == ("person",) and own.source.least_score == 0.3 and own.images is not None
    assert read_recording(path).pictured().sources[0].source.kind == "video"
    for wrong, message in (("score = 3", "a number of 0..1"), ('columns = { frme = "t" }', "did you mean frame")):
        path.write_text(text.replace("SOURCE", wrong))
        refused(RigError, message, read_recording, path)


def test_inspect_says_what_a_rig_delivers_and_draws_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from stseg.commands.inspect import inspect

    monkeypatch.setenv("COLUMNS", "200")
    yolo_text(tmp_path)
    rig = tmp_path / "rig.toml"
    rig.write_text(RIG.replace("PATH", "labels"))
    inspect(rig, output=tmp_path / "pictures")
    printed = capsys.readouterr().out
    assert "Ultralytics text" in printed and "person 3, car 2" in printed
    assert "do its frames count from 1? (first_frame = 1)" in printed
    assert (tmp_path / "pictures" / "a.png").stat().st_size > 1000
    (tmp_path / "labels" / "walk_1.txt").write_text("0 0.5\n")
    refused(FormatError, r"walk_1\.txt, line 1", inspect, rig)
