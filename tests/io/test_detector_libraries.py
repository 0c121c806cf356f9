"""Files that detectors' own libraries write: read as they are, and their malformed twins named in one line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stseg.arrays import Bytes
from stseg.errors import FormatError
from stseg.io.detections.masks import run_lengths
from stseg.io.detections.source_detections import instance_image, read_source
from stseg.io.recording.recording import Source

SIZE = (64, 48)


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
    own = run_lengths(**{key: _text(value) for key, value in tools.encode(np.asfortranarray(mask)).items()})
    np.testing.assert_array_equal(own.draw(SIZE), mask)
    assert own.box() == tuple(tools.toBbox(tools.encode(np.asfortranarray(mask))))


def _text(value: Any) -> Any:
    return value.decode() if isinstance(value, bytes) else value


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


@pytest.mark.parametrize(
    ("old", "new"), [('"counts": "', '"counts": "~'), ('"size": [48', '"size": [47'), ('"bbox": [', '"bbox": [[],')]
)
def test_malformed_results_are_one_line(tmp_path: Path, old: str, new: str) -> None:
    path, _ = coco_results(tmp_path)
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(FormatError, match=r"results.json: detection 0: found") as raised:
        read_source(Source("instances", path), SIZE)
    assert "\n" not in str(raised.value)


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
