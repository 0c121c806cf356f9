"""Hostile detections, answers and areas, found by fuzzing: read or refused in one line, in time."""

from __future__ import annotations

import json
import time
from pathlib import Path

import numpy as np
import pytest
from attacks import SECONDS

from stseg.errors import FormatError
from stseg.io.answers import read_answers, read_names
from stseg.io.detections.masks import RunLengths, polygons, run_lengths
from stseg.io.detections.record import Detections, last_numbers
from stseg.io.detections.source_detections import instance_image, read_source
from stseg.io.recording.recording import Source

SIZE = (64, 48)


def test_a_name_of_a_million_digits_is_numbered_in_time() -> None:
    begun = time.monotonic()
    numbers = last_numbers(["a" + "9" * 1_000_000, "7" * 1_000_000 + "b"])
    assert numbers is not None
    assert numbers.tolist() == [10**15 - 1, 777_777_777_777_777]
    assert time.monotonic() - begun < SECONDS


@pytest.mark.parametrize("points", [[[0.0, 0.0], [1.0, 0.0], [1e308, 1.0]], [[np.nan, 0.0]] * 3])
def test_outlines_far_beyond_an_image_are_refused(points: list[list[float]]) -> None:
    with pytest.raises(ValueError, match="far beyond"):
        polygons([np.array(points)])


@pytest.mark.parametrize("segments", [{"x": [1, 5, 10**400], "y": [1, 1, 9]}, {"x": [1e300, 5, 5], "y": [1, 1, 9]}, 7])
def test_segments_that_are_no_outline_are_refused(tmp_path: Path, segments: object) -> None:
    box = {"x1": 1, "y1": 2, "x2": 9, "y2": 20}
    (tmp_path / "r.json").write_text(json.dumps([[{"name": "person", "box": box, "segments": segments}]]))
    with pytest.raises(FormatError, match="frame 0, detection 0"):
        read_source(Source("instances", tmp_path / "r.json"), SIZE)


@pytest.mark.parametrize("seed", range(20))
def test_the_box_of_run_lengths_is_that_of_the_mask(seed: int) -> None:
    mask = np.random.default_rng(seed).random((9, 7)) < (seed + 1) / 40
    edges = np.flatnonzero(np.diff(np.r_[0, mask.T.ravel(), 0]))
    own = RunLengths((7, 9), np.diff(np.r_[0, edges, mask.size]))
    v, u = np.nonzero(mask)
    expected = (u.min(), v.min(), np.ptp(u) + 1, np.ptp(v) + 1) if len(u) else (0, 0, 0, 0)
    np.testing.assert_array_equal(own.draw((7, 9)), mask)
    assert own.box() == expected


def test_boxes_of_large_masks_take_no_images(tmp_path: Path) -> None:
    masks = [{"image_id": 0, "segmentation": {"size": [8000, 8000], "counts": [9, 63_999_991]}}] * 10_000
    (tmp_path / "r.json").write_text(json.dumps(masks))
    begun = time.monotonic()
    read_source(Source("boxes", tmp_path / "r.json"), SIZE)
    assert time.monotonic() - begun < SECONDS
    assert run_lengths([8000, 8000], [9, 63_999_991]).box() == (0.0, 0.0, 8000.0, 8000.0)


def test_a_parquet_file_of_many_rows_or_another_type_is_refused(tmp_path: Path) -> None:
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    path = tmp_path / "b.parquet"
    zeros = arrow.array(np.zeros(20_000_001, np.int8))
    names = ("frame", "left", "top", "width", "height")
    parquet.write_table(arrow.table(dict.fromkeys(names, zeros)), path, compression="zstd")
    assert path.stat().st_size < 1_000_000
    with pytest.raises(FormatError, match="rows, more than"):
        read_source(Source("boxes", path), SIZE)
    nested = arrow.array([[1]])
    parquet.write_table(arrow.table(dict.fromkeys(names, nested)), path)
    with pytest.raises(FormatError, match=r"row 0: found frame \[1\]"):
        read_source(Source("boxes", path), SIZE)


@pytest.mark.parametrize("name", ["\x1b[31m", "x" * 101, "a\0b", ""])
def test_names_of_people_are_printable(tmp_path: Path, name: str) -> None:
    (tmp_path / "names.csv").write_text(f"id,name\n1,{name}\n")
    with pytest.raises(FormatError, match="line 2: found name"):
        read_names(tmp_path / "names.csv")
    (tmp_path / "answers.csv").write_text(f"action,id,name\nname,1,{name}\n")
    with pytest.raises(FormatError, match="line 2: found name"):
        read_answers(tmp_path / "answers.csv", ("name",))


def test_names_may_be_anything_that_prints(tmp_path: Path) -> None:
    (tmp_path / "names.csv").write_text("id,name\n1,<b>Ann/Bob</b>\n2,Ω\n", "utf-8")
    assert read_names(tmp_path / "names.csv") == {1: "<b>Ann/Bob</b>", 2: "Ω"}


def test_boxes_far_beyond_the_image_become_no_masks() -> None:
    far = np.array([[-1e12, -1e12, 2e12, 2e12], [1e11, 5.0, 9.0, 9.0]])
    found = Detections(np.zeros(2, np.int64), far, np.ones(2))
    assert (instance_image(found, [0], SIZE) == 1).all()
    assert not instance_image(found, [1], SIZE).any()


@pytest.mark.parametrize("frames", [(1, 10**9), (1, 900_000), (5, 1)])
def test_keyframes_far_apart_are_refused(tmp_path: Path, frames: tuple[int, int]) -> None:
    steps = [{"frame": frame, "enabled": True, "x": 1, "y": 2, "width": 9, "height": 20} for frame in frames]
    track = {"type": "videorectangle", "value": {"sequence": steps, "labels": ["person"]}}
    (tmp_path / "s.json").write_text(json.dumps([{"data": {"video": "a"}, "annotations": [{"result": [track]}]}]))
    with pytest.raises(FormatError, match="result 0: found keyframes"):
        read_source(Source("boxes", tmp_path / "s.json"), SIZE)
