"""Box files of both forms, and files that detectors' own libraries write; what is none of them is named in one line."""

import json
from pathlib import Path

import numpy as np
import pytest
from cases import cases
from hypothesis import given, settings
from hypothesis import strategies as st
from recordings import data_path
from refusals import refused
from strategies import examples

from stseg.arrays import Bytes
from stseg.errors import FormatError, SourceError
from stseg.io.detections.box_files import read_boxes
from stseg.io.detections.masks import run_lengths
from stseg.io.detections.record import Detections
from stseg.io.detections.source_detections import instance_image, read_source
from stseg.io.recording.recording import Source

SIZE = (64, 48)


def read(folder: Path, text: str, first_frame: int = 0, frames: int | None = None) -> Detections:
    path = folder / "boxes.txt"
    path.write_text(text, encoding="utf-8")
    return read_boxes(path, first_frame, frames)


def test_csv_columns_come_in_any_order_and_others_are_ignored(tmp_path: Path) -> None:
    text = 'label,height,width,top,left,score,frame\n"a, b",4,3,2,1,0.5,0\n,40,30,20,10,1,2\n'
    table = read(tmp_path, text)
    assert table.frames == 3
    assert table.at(0).pixel.tolist() == [[1, 2, 3, 4]]
    assert table.at(0).score.tolist() == [0.5]
    assert table.at(1).pixel.shape == (0, 4)
    assert table.at(2).pixel.tolist() == [[10, 20, 30, 40]]


@pytest.mark.parametrize("text", ["\ufeffframe, left, top, width, height\n0, 1, 2, 3, 4\n", "0,7,1,2,3,4\n"])
def test_boxes_without_scores_are_believed(tmp_path: Path, text: str) -> None:
    assert read(tmp_path, text).at(0).score.tolist() == [1]


@pytest.mark.parametrize("separator", [",", " ", ", ", "  "])
def test_motchallenge_lines(tmp_path: Path, separator: str) -> None:
    lines = ["2 -1 5.5 6 7 8 0.25 -1 -1 -1", "1 -1 1e0 2 3 4 -1 -1 -1 -1"]
    table = read(tmp_path, "\n".join(line.replace(" ", separator) for line in lines) + "\n\n", first_frame=1)
    assert table.frames == 2
    assert table.at(0).pixel.tolist() == [[1, 2, 3, 4]]
    assert table.at(0).score.tolist() == [1]
    assert table.at(1).pixel.tolist() == [[5.5, 6, 7, 8]]
    assert table.at(1).score.tolist() == [0.25]


def test_frames_says_how_many_have_nothing(tmp_path: Path) -> None:
    assert read(tmp_path, "0 -1 1 2 3 4 1\n", frames=5).frames == 5
    assert len(read(tmp_path, "", frames=5).at(4)) == 0
    assert len(read(tmp_path, "frame,left,top,width,height\n", frames=5).at(0)) == 0


@cases((f"{'9' * 5000},1,2,3,4,1", "line 3: found frame"))
def test_bad_lines_are_named(tmp_path: Path, line: str, reported: str) -> None:
    text = f"frame,left,top,width,height,score\n0,1,2,3,4,1\n{line}\n0,1,2,3,4,1\n"
    refused(FormatError, reported, read, tmp_path, text)


def test_what_cannot_be_read_is_said(tmp_path: Path) -> None:
    refused(SourceError, "found no boxes", read, tmp_path, "")
    refused(SourceError, "No such file", read_boxes, tmp_path / "none.csv")
    refused(SourceError, "expected a file of boxes", read_boxes, tmp_path)
    (tmp_path / "binary").write_bytes(b"\xff\xfe\x00\x80")
    refused(FormatError, "text file in UTF-8", read_boxes, tmp_path / "binary")


@settings(max_examples=examples(30))
@given(st.lists(st.tuples(st.integers(3, 9), *[st.floats(0, 1e4) for _ in range(4)], st.floats(0, 1)), min_size=1))
def test_each_box_is_found_in_its_frame_in_the_order_of_the_file(tmp_path: Path, rows: list[tuple[float, ...]]) -> None:
    header = "frame,left,top,width,height,score\n"
    table = read(tmp_path, header + "".join(",".join(map(repr, row)) + "\n" for row in rows), first_frame=3)
    assert table.frames == max(row[0] for row in rows) - 2
    for frame in range(table.frames):
        expected = [row[1:] for row in rows if row[0] == frame + 3]
        found = table.at(frame)
        np.testing.assert_array_equal(np.column_stack([found.pixel, found.score]), np.reshape(expected, (-1, 5)))


@pytest.mark.parametrize(("name", "frames", "boxes"), [("CMC1_Cam1", 261, 1187), ("CMC2_Cam4", 263, 2221)])
def test_real_detections(name: str, frames: int, boxes: int) -> None:
    path = data_path(f"cmc/DET_{name}.txt")
    table = read_boxes(path, first_frame=1)
    assert table.frames == frames
    assert sum(len(table.at(frame)) for frame in range(frames)) == boxes
    assert set(table.score) == {1.0}


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


def test_results_of_pycocotools_are_read(tmp_path: Path) -> None:
    path, masks = coco_results(tmp_path)
    found = read_source(Source("instances", path), SIZE)
    assert (found.format, found.frames, found.kept.score.tolist()) == ("COCO results", 3, [0.5, 0.6, 0.7])
    for frame, mask in enumerate(masks):
        np.testing.assert_array_equal(instance_image(found.kept, [frame], SIZE), mask)


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
