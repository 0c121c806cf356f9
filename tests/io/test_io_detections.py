"""Detections: box files of both forms, and each format of detectors and annotation tools with its malformed twin."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from attacks import write_rig
from checks import Captured, cases, data_path, drawn, frozen, refused, tables
from hypothesis import strategies as st

from stseg import Camera, InputError, Source, read_recording
from stseg.arrays import Bytes
from stseg.commands.inspect import inspect
from stseg.errors import FormatError, RigError, SourceError
from stseg.io.detections.box_files import read_boxes
from stseg.io.detections.masks import run_lengths
from stseg.io.detections.packed_numbers import PackedNumbers
from stseg.io.detections.record import Detections, listed_frames
from stseg.io.detections.source_detections import instance_image, read_source
from stseg.io.recording.streams import open_stream

SIZE = (80, 60)


def read(folder: Path, text: str, first_frame: int = 0, frames: int | None = None) -> Detections:
    path = folder / "boxes.txt"
    path.write_text(text, encoding="utf-8")
    return read_boxes(path, first_frame, frames)


@pytest.mark.parametrize("text", ["\ufeffframe, left, top, width, height\n0, 1, 2, 3, 4\n", "0,7,1,2,3,4\n"])
def test_boxes_without_scores_are_believed(tmp_path: Path, text: str) -> None:
    assert read(tmp_path, text).at(0).score.tolist() == [1]


@pytest.mark.parametrize("separator", [",", " ", ", ", "  "])
def test_motchallenge_lines(tmp_path: Path, separator: str) -> None:
    lines = ["2 -1 5.5 6 7 8 0.25 -1 -1 -1", "1 -1 1e0 2 3 4 -1 -1 -1 -1"]
    table = read(tmp_path, "\n".join(line.replace(" ", separator) for line in lines) + "\n\n", first_frame=1)
    assert table.frames == 2 and table.at(0).pixel.tolist() == [[1, 2, 3, 4]]
    assert table.at(0).score.tolist() == [1] and table.at(1).pixel.tolist() == [[5.5, 6, 7, 8]]
    assert table.at(1).score.tolist() == [0.25]


@cases((f"{'9' * 5000},1,2,3,4,1", "line 3: found frame"))
def test_bad_lines_are_named(tmp_path: Path, line: str, reported: str) -> None:
    text = f"frame,left,top,width,height,score\n0,1,2,3,4,1\n{line}\n0,1,2,3,4,1\n"
    refused(FormatError, reported, read, tmp_path, text)


def test_columns_come_in_any_order_and_files_that_are_none(tmp_path: Path) -> None:
    refused(SourceError, "found no boxes", read, tmp_path, "")
    refused(SourceError, "No such file", read_boxes, tmp_path / "none.csv")
    refused(SourceError, "expected a file of boxes", read_boxes, tmp_path)
    (tmp_path / "binary").write_bytes(b"\xff\xfe\x00\x80")
    refused(FormatError, "text file in UTF-8", read_boxes, tmp_path / "binary")
    text = 'label,height,width,top,left,score,frame\n"a, b",4,3,2,1,0.5,0\n,40,30,20,10,1,2\n'
    table = read(tmp_path, text)
    assert table.frames == 3 and table.at(0).pixel.tolist() == [[1, 2, 3, 4]]
    assert table.at(0).score.tolist() == [0.5] and table.at(1).pixel.shape == (0, 4)
    assert table.at(2).pixel.tolist() == [[10, 20, 30, 40]]


@drawn(30, st.lists(st.tuples(st.integers(3, 9), *[st.floats(0, 1e4) for _ in range(4)], st.floats(0, 1)), min_size=1))
def test_each_box_is_found_in_its_frame_in_the_order_of_the_file(tmp_path: Path, rows: list[tuple[float, ...]]) -> None:
    header = "frame,left,top,width,height,score\n"
    table = read(tmp_path, header + "".join(",".join(map(repr, row)) + "\n" for row in rows), first_frame=3)
    assert table.frames == max(row[0] for row in rows) - 2
    for frame in range(table.frames):
        expected = [row[1:] for row in rows if row[0] == frame + 3]
        found = table.at(frame)
        np.testing.assert_array_equal(np.column_stack([found.pixel, found.score]), np.reshape(expected, (-1, 5)))


@drawn(
    60,
    st.lists(
        st.sampled_from((0.0, -0.0, 0.3, 1e5)) | st.integers(-(10**7), 10**7).map(lambda k: k / 1000) | st.floats(0, 1)
    ),
)
def test_packed_numbers_keep_their_bits(numbers: list[float]) -> None:
    assert PackedNumbers.of(np.array(numbers))[:].tobytes() == np.array(numbers).tobytes()
    assert PackedNumbers.of(np.array([-0.0, 0.25])).whole.nbytes == 4


@pytest.mark.parametrize(("name", "frames", "boxes"), [("CMC1_Cam1", 261, 1187), ("CMC2_Cam4", 263, 2221)])
def test_real_detections(name: str, frames: int, boxes: int) -> None:
    path = data_path(f"cmc/DET_{name}.txt")
    table = read_boxes(path, first_frame=1)
    assert table.frames == frames and sum(len(table.at(frame)) for frame in range(frames)) == boxes
    assert set(table.score[:]) == {1.0}


def blob(seed: int) -> Bytes:
    """The mask of a leaning ellipse with holes, uint8 (v, u)."""
    random, (v, u) = np.random.default_rng(seed), np.mgrid[: SIZE[1], : SIZE[0]]
    middle, wide, tall = random.uniform(15, 35, 2), random.uniform(3, 9), random.uniform(6, 14)
    inside = ((u - middle[0] - 0.3 * v) / wide) ** 2 + ((v - middle[1]) / tall) ** 2 < 1
    return np.asarray(inside & (random.random(inside.shape) > 0.1), np.uint8)


@pytest.mark.parametrize("seed", range(5))
def test_masks_of_pycocotools(seed: int) -> None:
    tools = pytest.importorskip("pycocotools.mask")
    mask = blob(seed)
    encoded = tools.encode(np.asfortranarray(mask))
    own = run_lengths(encoded["size"], encoded["counts"].decode())
    np.testing.assert_array_equal(own.draw(SIZE), mask)
    assert own.box() == tuple(tools.toBbox(encoded))


def coco_results(folder: Path) -> tuple[Path, list[Bytes]]:
    """Results as Detectron2 and MMDetection write them with pycocotools: boxes of masks, scores, categories."""
    tools = pytest.importorskip("pycocotools.mask")
    masks = [blob(seed) for seed in range(3)]
    coded = [tools.encode(np.asfortranarray(mask)) for mask in masks]
    rows = [
        {"image_id": frame, "category_id": 1, "score": 0.5 + frame / 10, "bbox": tools.toBbox(one).tolist(),
         "segmentation": {"size": one["size"], "counts": one["counts"].decode()}}
        for frame, one in enumerate(coded)
    ]  # fmt: skip
    (folder / "results.json").write_text(json.dumps(rows))
    return folder / "results.json", masks


@pytest.mark.filterwarnings("ignore:Operation with tuple")  # of pandas, by motmetrics
def test_truth_of_motmetrics_is_read(tmp_path: Path) -> None:
    """A table of the package's own frames, written as its loader reads it."""
    motmetrics, pandas = pytest.importorskip("motmetrics"), pytest.importorskip("pandas")
    columns = ["FrameId", "Id", "X", "Y", "Width", "Height", "Confidence", "ClassId", "Visibility"]
    table = pandas.DataFrame([[1, 1, 10, 12, 20, 30, 1, 1, 0.8], [3, 1, 5, 6, 10, 24, 1, 1, 1.0]], columns=columns)
    table.to_csv(tmp_path / "gt.txt", index=False, header=False)
    theirs = motmetrics.io.loadtxt(tmp_path / "gt.txt", fmt="mot15-2D", min_confidence=1)
    found = read_source(Source("boxes", tmp_path / "gt.txt", 1), SIZE)
    assert found.format == "MOTChallenge truth" and found.frames == 3
    shift = np.array([1, 1, 0, 0])  # motmetrics counts pixels from 0, the files from 1
    np.testing.assert_allclose(found.kept.pixel - shift, theirs[["X", "Y", "Width", "Height"]].to_numpy())


BOXES = {0: [(10.0, 12.0, 20.0, 30.0, 0.9)], 2: [(5.0, 6.0, 10.0, 24.0, 0.5), (40.0, 8.0, 16.0, 40.0, 0.25)]}
"""By frame: left, top, width, height, score."""
SAMPLES = Path(__file__).parent / "detections"
"""A folder a format, with the boxes as its program writes them."""
FORMATS = tables(Path(__file__).with_suffix(".toml"))["formats"]
"""The file or folder of each, and the keys of its source."""
ANNOTATED = ("WILDTRACK", "MOTChallenge truth", "CVAT XML", "Label Studio", "VIA")
"""Formats without scores."""


def sample(folder: Path, name: str) -> Source:
    """A copy of a format's files, and their source."""
    if name == "Parquet":
        pytest.importorskip("pyarrow")
    shutil.copytree(SAMPLES / name.lower().replace(" ", "_"), folder, dirs_exist_ok=True)
    (file, keys), images = FORMATS[name], folder / "images.json"
    given = {key: frozen(value) for key, value in keys.items()}
    return Source("boxes", folder / file, **given, image_list=images if images.exists() else None)


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_gives_the_same_boxes(tmp_path: Path, name: str) -> None:
    source = sample(tmp_path, name)
    if (path := source.path).suffix in (".json", ".xml"):  # the content says what it is
        source = replace(source, path=path.rename(path.with_suffix("")))
    found = read_source(source, SIZE)
    assert name.startswith(found.format) and found.frames == 3
    for frame in range(3):
        boxes, own = found.table.at(frame), BOXES.get(frame, [])
        np.testing.assert_allclose(boxes.pixel.reshape(-1, 4), np.array([b[:4] for b in own]).reshape(-1, 4), atol=1e-6)
        np.testing.assert_allclose(boxes.score, [1.0 if name in ANNOTATED else b[4] for b in own])


@cases()
def test_a_malformed_twin_is_one_line(tmp_path: Path, name: str, file: str, old: str, new: str, message: str) -> None:
    made = sample(tmp_path, name)
    path = tmp_path / file
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    assert "\n" not in refused(InputError, message, read_source, made, SIZE)


@cases()
def test_annotations_of_other_cameras_and_shapes(tmp_path: Path, file: str, content: object, message: str) -> None:
    text = f"<annotations>{content}</annotations>" if file == "a.xml" else json.dumps(content)
    (tmp_path / file).write_text(text)
    refused(InputError, message, read_source, Source("boxes", tmp_path / file), SIZE)


@cases(("width", None, r"header: found the columns frame, left, top, height, score"))
def test_malformed_parquet_is_one_line(tmp_path: Path, column: str, values: list[object] | None, message: str) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet as writer

    columns = {"frame": [0, 1], "left": [1, 1], "top": [2, 2], "width": [4, 4], "height": [3, 3], "score": [0.5, 0.5]}
    chosen = {name: values if name == column else own for name, own in columns.items()}
    table = {name: own for name, own in chosen.items() if own is not None}
    writer.write_table(pyarrow.table(table), tmp_path / "b.parquet")
    assert "\n" not in refused(InputError, message, read_source, Source("boxes", tmp_path / "b.parquet"), SIZE)


def test_classes_flags_and_scores_choose(tmp_path: Path) -> None:
    made = sample(tmp_path, "Ultralytics text")
    assert read_source(Source("boxes", made.path, 1), SIZE).read.classes() == {"person": 3, "car": 2}
    assert len(read_source(Source("boxes", made.path, 1, classes=("car",)), SIZE).kept) == 2
    assert len(read_source(Source("boxes", made.path, 1, least_score=0.6), SIZE).kept) == 3
    said = r"no detections of persn; classes are person \(3\), car \(2\)"
    refused(SourceError, said, read_source, Source("boxes", made.path, 1, classes=("persn",)), SIZE)
    path = tmp_path / "gt.txt"
    path.write_text("1,1,10,12,20,30,1,1,0.8\n1,2,1,1,5,5,0,1,1\n3,1,5,6,10,24,1,3,1\n")
    found = read_source(Source("boxes", path, 1), SIZE)
    assert found.format == "MOTChallenge truth" and found.read.classes() == {"car": 1, "pedestrian": 1}
    assert len(read_source(Source("boxes", path, 1, classes=("pedestrian",)), SIZE).kept) == 1


def test_results_of_pycocotools_without_scores_and_outlines(tmp_path: Path) -> None:
    (tmp_path / "v_0.txt").write_text("0 0.5 0.5 0.1 0.2 1\n0 0.2 0.5 0.1 0.2 2\n")
    assert read_source(Source("boxes", tmp_path), SIZE).kept.score[:].tolist() == [1, 1]
    (tmp_path / "v_0.txt").write_text(f"0 0.5 0.5 0.1 0.2 {'0.3 0.4 0.9 ' * 17} 0.75\n")
    found = read_source(Source("boxes", tmp_path), SIZE)
    assert found.kept.score[:].tolist() == [0.75] and not found.kept.mask
    path, masks = coco_results(tmp_path)
    found = read_source(Source("instances", path), SIZE)
    assert (found.format, found.frames, found.kept.score[:].tolist()) == ("COCO results", 3, [0.5, 0.6, 0.7])
    for frame, mask in enumerate(masks):
        np.testing.assert_array_equal(instance_image(found.kept, [frame], SIZE), mask)


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


def test_frames_are_counted_as_said_and_wrong_keys_named(tmp_path: Path) -> None:
    assert listed_frames(Path("a"), ["a_10.png", "a_20.png", "a_0.png"])[0].tolist() == [1, 2, 0]
    numbers, count = listed_frames(Path("a"), ["a_10.png", "a_20.png", "a_90.png"])
    assert numbers.tolist() == [10, 20, 90] and count is None
    frames, count = listed_frames(Path("a"), ["x", "y"])
    assert frames.tolist() == [0, 1] and count == 2
    assert read(tmp_path, "0 -1 1 2 3 4 1\n", frames=5).frames == 5
    assert len(read(tmp_path, "", frames=5).at(4)) == 0
    assert len(read(tmp_path, "frame,left,top,width,height\n", frames=5).at(0)) == 0
    old, new = '"boxes.csv" }', '"x.json", SOURCE }\nimages = { kind = "video", path = "x.mp4" }'
    keys = 'classes = ["person"], score = 0.3, columns = { frame = "t" }'
    path = write_rig(tmp_path, old, new.replace("SOURCE", keys))
    (own,) = read_recording(path).sources
    assert own.source.classes == ("person",) and own.source.least_score == 0.3 and own.images is not None
    assert read_recording(path).pictured().sources[0].source.kind == "video"
    for wrong, message in (("score = 3", "a number from 0 to 1"), ('columns = { frme = "t" }', "did you mean frame")):
        refused(RigError, message, read_recording, write_rig(tmp_path, old, new.replace("SOURCE", wrong)))


def test_inspect_says_what_a_rig_delivers_and_draws_it(
    tmp_path: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    sample(tmp_path, "Ultralytics text")
    rig = write_rig(tmp_path, '"boxes.csv"', '"labels"')
    inspect(rig, output=tmp_path / "pictures")
    printed = capsys.readouterr().out
    assert "Ultralytics text" in printed and "person 3, car 2" in printed
    assert "do frames count from 1? (first_frame = 1)" in printed
    assert (tmp_path / "pictures" / "cam1.png").stat().st_size > 1000
    (tmp_path / "labels" / "walk_1.txt").write_text("0 0.5\n")
    refused(FormatError, r"walk_1\.txt, line 1", inspect, rig)
