"""What readers of detections and calibrations refuse: the place, what was found, what was expected, in one line."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from refusals import refused

from stseg.errors import FormatError, InputError
from stseg.io.answers import read_answers, read_names
from stseg.io.calibrations.formats import ImportOptions, read_cameras
from stseg.io.detections.source_detections import read_source
from stseg.io.recording.recording import Source
from stseg.io.track_csv import read_tracks_csv as tracks
from stseg.io.untrusted import limits

SIZE = (80, 60)
UNKNOWN = """{} [] 1 [1] null [{}] [[]] [[],[]] [[1]] [[{}]] [[{"box":1}]] [[{"box":{}}]] {"a":1} {"predictions":{}}
{"predictions":[]} [[{"box":{"x1":1}}],1] [{"image_id":1}] [{"bbox":[]}] ["images","annotations"] {"images":[]}
{"annotations":[]} [["labels","scores","bboxes"]] [["annotations"]] ["annotations"] {"a":{"filename":1}} [{"left":1}]
{"a":{"regions":1}} {"a":["filename","regions"]} {"_via_img_metadata":[1]} {"_via_img_metadata":{}} [{"frame":1}]
[{"left":1,"top":1,"width":1,"height":1}]"""
OF_FRAMES = '{} 1 [1] [{}] [{"personID":1}] {"personID":1,"views":1} ["labels","scores","bboxes"] {"labels":1}'
WILDTRACK = '[{"personID":1,"views":[{"viewNum":1,"xmin":1,"ymin":1,"xmax":2,"ymax":3}]}]'


def read(folder: Path, name: str, text: str, **keys: Any) -> object:
    """A source of one file, or of the folder that holds it; keys in capitals are limits."""
    (folder / name).parent.mkdir(exist_ok=True)
    (folder / name).write_text(text)
    return read_source(Source("boxes", folder / name.split("/")[0], **keys), SIZE)


@pytest.mark.parametrize(("name", "texts"), [("x.json", UNKNOWN), ("d/0.json", OF_FRAMES)])
def test_unknown_json_is_named(tmp_path: Path, name: str, texts: str) -> None:
    for text in texts.split():
        refused(InputError, "found JSON of no known detections, expected one of Ultral", read, tmp_path, name, text)


@pytest.mark.parametrize(
    ("name", "text", "keys", "message"),
    [
        ("x.json", "{\n no json", {}, "x.json: line 2: found no JSON"),
        ("d/a.txt", "0 .5 .5 .1 .1", {}, "1 text files whose names do not number their frames"),
        ("d/a.md", "", {}, "d: found a folder without text or JSON files"),
        ("d/0.json", WILDTRACK, {}, "view: found no number of the camera"),
        ("d/0.json", WILDTRACK, {"view": 7}, "view 7: found no such viewNum"),
        ("x.xml", "<a/>", {}, "x.xml: found <a>, expected CVAT's XML: <annotations>"),
        ("x.xml", "<annotations><meta><task><size>1e9</size></task></meta></annotations>", {}, "1e.09 frames"),
        ("x.json", '[{"image_id":"cat","bbox":[1,2,3,4]}]', {}, "detection 0: found image_id 'cat', expected a number"),
        ("x.json", '[{"image_id":1e3,"bbox":[1,2,3,4]}]', {}, "detection 0: found image_id 1000.0, expected a number"),
        ("x.json", '[{"image_id":1,"bbox":"1234"}]', {}, "detection 0: found a box of 1 numbers, expected 4"),
        ("x.json", '[{"bboxes":["1234"],"scores":[1],"labels":[0]}]', {}, "frame 0: found a box '1234'"),
        ("x.json", '[{"image_id":1,"bbox":[1,2,3,4]}]', {"image_list": True}, "images: found nothing, expected the im"),
        ("x.json", '[{"image_id":20000001,"bbox":[1,2,3,4]}]', {}, "detection 0: found frame 20000001, row 1"),
        ("x.json", '[{"image_id":5,"bbox":[1,2,3,4]}]', {"frames": 5}, "found frame 5, expected a frame below 5"),
        ("x.json", '[{"image_id":5,"bbox":[1,2,3,4]},{"image_id":5,"bbox":[1,2,3,4]}]', {}, "2 boxes in a frame"),
        ("x.json", '[{"image_id":1,"segmentation":{"size":[0,4],"counts":[0]}}]', {}, "an image of 4 x 0"),
        ("x.json", '[{"image_id":1,"segmentation":{"size":[2,2],"counts":"P"}}]', {}, "end within a number"),
        ("x.json", f'[{{"image_id":1,"segmentation":{{"size":[2,2],"counts":"{"P" * 99}"}}}}]', {}, "more digits than"),
        ("x.json", '{"images":[{"id":1,"file_name":"a"}],"annotations":[]}', {"select": "b"}, "select: found no image"),
        ("x.json", '[{"bboxes":[[1,2,3]],"scores":[1],"labels":[0]}]', {}, r"frame 0: found a box \[1, 2, 3\]"),
        ("x.json", '[[{"box":{"x1":1,"y1":1,"x2":2,"y2":2},"segments":{"x":[1,2,3],"y":[1]}}]]', {}, "of 3 x and 1 y"),
        ("x.json", '[{"image_id":1,"segmentation":{"size":[7,8],"counts":"=331OO10;"}}]', {}, "for an image of 8 x 7"),
        ("x.json", '[{"image_id":1,"segmentation":{"size":[2,2],"counts":"~"}}]', {}, "that are not COCO"),
        ("x.json", '[{"image_id":1,"segmentation":[[0,0,1,1]]}]', {}, "a polygon of fewer than 3 points"),
        ("x.json", '[{"image_id":1,"segmentation":[[0,0,1,1,1e9,1]]}]', {}, "a polygon far beyond any image"),
        ("x.json", f'[[{{"box":{{"x1":1}},"segments":{{"x":[1{"0" * 400}],"y":[1]}}}}]]', {}, "detection 0: found x"),
        ("x.txt", "0 1 1 2 3 4 1", {"classes": ("a",)}, "classes: found a, expected detections that have classes"),
        ("x.txt", "0 1 1 2 3 4 1\n0 1 1 2 3 4 1", {}, "more than 1 boxes in frame 0"),
        ("x.txt", "frame,left,top\n0,1,2", {}, "line 1: found no column width, height"),
        ("x.txt", "0,10.5,20,30,40,0.9", {}, "line 1: found id 10.5.*or a header"),
        ("x.txt", "0,1,2,3", {}, "line 1: found 4 fields"),
        ("x.txt", "5 -1 1 2 3 4 1", {"frames": 3}, "line 1: found frame 5, expected a frame below 3, for there"),
        ("x.txt", "0 1 1 2 3 4 1\n1 1 1 2 3 4 1\n2 1 1 2 3 4 1", {}, "more than 2 rows"),
    ],
)  # fmt: skip
def test_detections_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, text: str, keys: dict[str, Any], message: str
) -> None:
    monkeypatch.setattr(limits, "BOXES_PER_FRAME", 1)
    monkeypatch.setattr(limits, "ROWS", 2)
    keys = keys | ({"image_list": tmp_path / name} if "image_list" in keys else {})
    assert "\n" not in refused(InputError, message, read, tmp_path, name, text, **keys)


TSAI = """<Camera><Geometry width="768" height="576" dpx="0.01" dpy="0.01"/>
<Intrinsic focal="5" kappa1="0" cx="300" cy="200" sx="1"/><Extrinsic tx="0" ty="0" tz="9" rx="0" ry="0" rz="0"/>
</Camera>"""
OPENCV = """<opencv_storage><camera_matrix>500.0 0.0 320 0 510 240 0 0 1</camera_matrix><distortion_coefficients>
-0.107 0 0 0 0</distortion_coefficients><rvec>-1.2 0 0</rvec><tvec>0 1 2</tvec></opencv_storage>"""
KRT = '{"a": {"K": [500,0,320,0,500,240,0,0,1], "RT": [1,0,0,0,0,1,0,0,0,0,1,9]}}'
POSES = """[metadata]
[cam_0]\nname = "a"\nsize = [64, 48]\nmatrix = [[500.0,0,1],[0,500,1],[0,0,1]]
distortions = [1, 1, 1, 1, 1]\nrotation = [0, 0, 0]\ntranslation = [1, 1, 1]\nfisheye = false"""
SENSORS = '{"sensors": [{"id": "c", "cameraMatrix": [[1,0,0,0],[0,1,0,0],[0,0,1,0]]}]}'
PLANES = "1 0 0\n0 1 0\n0 0 1\n"


@pytest.mark.parametrize(
    ("format", "name", "text", "old", "new", "message"),
    [
        ("tsai", "c.xml", TSAI, "Geometry", "Geo", "Geometry: found no such node, expected one with width height"),
        ("tsai", "c.xml", TSAI, "768", "x", "Geometry: found no finite number: x 576 0.01 0.01"),
        ("tsai", "c.xml", TSAI, "768", "0.5", "Geometry: found 0.5 x 576 pixels, expected an image"),
        ("tsai", "c.xml", TSAI, "0.01", "-1", "found a length that is not above 0"),
        ("tsai", "c.xml", TSAI, "0.01", "1e-320", "numbers that make no camera"),
        ("tsai", "c.xml", TSAI, "<Cam", "<!DOCTYPE x [<!ENTITY a 'b'>]><Cam", "a document type declaration"),
        ("opencv", "c.xml", OPENCV, "camera_matrix", "camera", "camera_matrix: found 0 such nodes, expected one"),
        ("opencv", "c.xml", OPENCV, "<tvec>", "<tvec>1 2 3</tvec><tvec>", "found 2 such nodes"),
        ("opencv", "c.xml", OPENCV, "500.0", "five", "camera_matrix: found 9 numbers: five .* expected 9 num"),
        ("opencv", "c.xml", OPENCV, "500.0", "-500.0", r"camera_matrix: found \[\[-500.0"),
        ("opencv", "c.xml", OPENCV, "0 0 0 0<", "0 0 0 0 0 0 0 0 0 0 1<", "found 12 coefficients, expected at most 8"),
        ("opencv", "c.xml", OPENCV, "</opencv_storage>", "", "found what is not XML"),
        ("pom", "c.txt", PLANES, "0 0 1", "", "2 lines of three numbers"),
        ("pom", "c.txt", PLANES * 2, "0 0 1", "0 0 0", "homography: found a singular matrix"),
        ("pom", "c.txt", PLANES * 2, "0 0 1", "-1 -100 5939", "homography: found a ground plane that the image hardly"),
        ("matrix", "c.txt", "1 " * 12, "1", "1e999", "found what cannot be read .a word that is no finite number"),
        ("matrix", "c.mat", "1 " * 12, "1", "2", "no MAT-file of version 5 to 7.3"),
        ("krt", "c.json", KRT, '"a"', '"a/b"', "camera: found 'a/b', expected a name"),
        ("krt", "c.json", KRT, '"RT": [1', '"RT": [2', r"rotation: found \[\[2.0"),
        ("krt", "c.json", KRT, KRT, "[" * 100_000, "what is not JSON"),
        ("krt", "c.json", KRT, KRT, "[1]", "found no table of cameras, expected one, in JSON"),
        ("krt", "c.json", KRT, '{"a"', f'{{"b":{KRT[6:-1]}, "c":{KRT[6:-1]}, "a"', "3 cameras, expected at most 2"),
        ("nvidia", "c.json", SENSORS, '"c"', "[[1]]", "id"),
        ("nvidia", "c.json", SENSORS, "cameraMatrix", "homography", "Matrix: found nothing, .* `stseg calibrate po"),
        ("anipose", "c.toml", POSES, "fisheye = false", "fisheye = true", "found 5 coefficients, expected at most 4"),
        ("anipose", "c.toml", POSES, "[500.0", '["500.0"', r"cam_0.matrix: found .* expected 3 rows of 3 numbers"),
        ("anipose", "c.toml", POSES, "500.0", "-500.0", r"camera a, camera_matrix"),
        ("anipose", "c.toml", POSES, "rotation =", "rot =", "no camera, expected tables with matrix"),
        ("anipose", "c.toml", POSES, "[metadata]", "[metadata", "what is not TOML"),
        ("anipose", "c.toml", "a = 1", "1", "2", "no camera, expected tables with matrix"),
        ("anipose", "c.toml", "a = 1", "1", "[]", "no camera, expected tables with matrix"),
        ("kalibr", "c.yaml", "[" * 99, "[", "[", "nested brackets"),
        ("kalibr", "c.yaml", "1: 2", "1", "3", "no table of cameras, expected one, in YAML"),
    ],
)  # fmt: skip
def test_calibrations_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, format: str, name: str, text: str, old: str, new: str, message: str
) -> None:
    if format == "kalibr":
        pytest.importorskip("yaml")
    monkeypatch.setattr(limits, "CAMERAS", 2)
    (tmp_path / name).write_text(text.replace(old, new))
    said = refused(InputError, message, read_cameras, format, [tmp_path / name], ImportOptions(SIZE, "m", 1.8))
    assert "\n" not in said and f"{name}: " in said


@pytest.mark.parametrize(("size", "unit", "missing"), [(None, "m", "--size"), (SIZE, None, "--unit")])
def test_homographies_of_pom_need_size_and_unit(size: Any, unit: str | None, missing: str) -> None:
    refused(InputError, f"{missing}: found nothing", read_cameras, "pom", [], ImportOptions(size, unit, 1.8))


def answers(path: Path) -> object:
    """Answers of a review to its questions."""
    return read_answers(path, ("split", "swap"))


@pytest.mark.parametrize(
    ("reader", "text", "message"),
    [
        (answers, "frame,id\n1,2\n", "header: found frame,id, expected the columns action"),
        (answers, "action,frame,id\nswitch,1,2\n", "line 2: found action 'switch'"),
        (answers, "action,frame,id\nsplit,x,2\n", "line 2: found frame 'x', expected a whole number"),
        (answers, "action,frame,id\nsplit,4,\n", "line 2: found no id"),
        (read_names, "id,name\n3,Ann\n3,Bo\n", "line 3: found id 3 twice"),
        (read_names, "id,name\n,Ann\n", "line 2: found no id"),
        (tracks, "frame,id,x,y\n0,1,0,0\n1,1,nan,0\n", "line 3, column x: found 'nan', expected a finite number"),
        (tracks, "frame,id,x,y\n0,1,0,-inf\n", "line 2, column y: found '-inf', expected a finite number"),
        (tracks, "frame,id,x,y\n0,1,here,0\n", "line 2, column x: found 'here'"),
        (tracks, "frame,id,x,y\n0,1,,0\n", "line 2, column x: found ''"),
        (tracks, "frame,id,x,y\n0.5,1,0,0\n", "line 2, column frame: found '0.5', expected a whole number"),
        (tracks, "frame,id,x,y\n1e300,1,0,0\n", "line 2, column frame: found '1e300', expected a finite number"),
        (tracks, "frame,id,x,y\n0,,0,0\n", "line 2, column id: found ''"),
        (tracks, "frame,id,x,y,flag\n0,1,0,0,bad\n", "line 2, column flag: found 'bad'"),
        (tracks, "frame,id,x,y\n0,1,0,0\n\n1,2,0,0\n0,1,2,2\n", "line 5, column id: found '1' again in the same"),
        (tracks, "frame,id,x,y\n0,1,0\n", "line 2: found 3 cells, expected 4"),
        (tracks, "frame,id,x\n0,1,0\n", r"header: found frame,id,x, expected columns frame,id,x,y \(no y\)"),
        (tracks, "frame;id;x;y\n0;1;0;0\n", "header: found frame;id;x;y"),
        (tracks, "0,1,0.5,0.5\n", "header: found 0,1,0.5,0.5"),
        (tracks, "", "header: found nothing"),
    ],
)  # fmt: skip
def test_tables_are_refused(tmp_path: Path, reader: Callable[[Path], object], text: str, message: str) -> None:
    (tmp_path / "t.csv").write_text(text)
    assert "\n" not in refused(FormatError, f"t.csv: {message}", reader, tmp_path / "t.csv")
