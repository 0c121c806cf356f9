"""Files of any kind and detections from strangers: a result, or one line that names the file."""

import json
import os
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from attacks import RIG, write_rig
from checks import REFUSAL_TIME, Command, in_ci, refused
from recordings import COMMAND, process

from stseg.commands.main import main
from stseg.errors import FormatError, OutputError
from stseg.io.detections.masks import RunLengths, run_lengths
from stseg.io.detections.record import Detections, last_numbers
from stseg.io.detections.source_detections import instance_image, read_source
from stseg.io.outputs.whole_files import NO_INPUTS
from stseg.io.recording.recording import Source
from stseg.io.recording.rigs import parse_rig, read_recording
from stseg.io.runfile.provenance import gather_provenance, run_request
from stseg.io.runfile.unfinished.work_folder import WorkFolder


@pytest.mark.parametrize("name", ["cam 1", "Ω", "2026-01-01T10:30:00", "<script>", "a.b"])
def test_unusual_names_work(name: str) -> None:
    assert parse_rig(RIG.replace('"cam1"', json.dumps(name)), Path("rig.toml")).rig.cameras[0].name == name


def test_foreign_files_and_folders_called_removed_stay(tmp_path: Path) -> None:
    for number, names in enumerate((("begun.json",), ("begun.json", "stseg-work-folder", "thesis.txt"))):
        folder = tmp_path / f"q.h5.segments.{number:016x}.removed"
        folder.mkdir()
        for name in names:
            (folder / name).write_text("precious")
    before = sorted(tmp_path.rglob("*"))
    WorkFolder(tmp_path / "q.h5", {}).require_output(False, NO_INPUTS)
    assert sorted(tmp_path.rglob("*")) == before
    with WorkFolder(tmp_path / "q.h5", {}) as work:
        (work.path / "thesis.txt").write_text("precious")
        work.remove()
    assert (tmp_path / "q.h5.segments" / "thesis.txt").read_text() == "precious"
    with WorkFolder(tmp_path / "q.h5", {}) as work:
        (work.path / "thesis.txt").unlink()
        work.remove()
    assert not (tmp_path / "q.h5.segments").exists()


def test_foreign_folders_and_links_are_left_alone(tmp_path: Path, refusal: Command) -> None:
    (tmp_path / "else").mkdir()
    with WorkFolder(tmp_path / "else" / "q.h5", {}) as work:
        (tmp_path / "r.h5.segments").symlink_to(work.path)
        refusal("run", write_rig(tmp_path), "-o", tmp_path / "r.h5")
        assert work.begun
        (work.path / "begun.json").unlink()  # as before another run has written it
        refused(OutputError, "another run", WorkFolder(tmp_path / "else" / "q.h5", {}).__enter__)
        assert work.path.exists()
    rig, folder = write_rig(tmp_path), tmp_path / "q.h5.segments"
    folder.mkdir()
    names = ("thesis.txt", "begun.json", "segment-00000.h5")
    for name in names:
        (folder / name).write_text("precious")
    for more in ((), ("--frames", "5:3"), ("--overwrite",)):
        assert "did not make" in refusal("run", rig, "-o", tmp_path / "q.h5", *more)
    assert {path.name: path.read_text() for path in folder.iterdir()} == dict.fromkeys(names, "precious")


def test_links_and_files_beside_an_output_are_not_written_to(run_path: Path) -> None:
    target, link, plain = (run_path.with_name(name) for name in ("target", "t.csv.part", "u.csv.part"))
    target.write_text("precious")
    plain.write_text("precious")
    link.symlink_to(target)
    for name in ("t.csv", "u.csv"):
        assert main(["export", str(run_path), "--to", "csv", "-o", str(run_path.with_name(name))]) == 0
    assert (target.read_text(), plain.read_text(), link.is_symlink()) == ("precious", "precious", True)
    assert not run_path.with_name("t.csv").is_symlink()


def test_a_recording_that_changed_in_place_is_noticed(tmp_path: Path) -> None:
    recording, path = read_recording(write_rig(tmp_path)), tmp_path / "boxes.csv"
    before, state = run_request(recording, gather_provenance(recording, "")), path.stat()
    path.write_text(path.read_text().replace("3,11", "3,12"))
    os.utime(path, ns=(state.st_atime_ns, state.st_mtime_ns))
    assert run_request(recording, gather_provenance(recording, "")) != before


@pytest.mark.skipif(sys.platform != "linux", reason="needs a limit of file sizes that can be set")
@pytest.mark.parametrize("to", ["sqlite", *in_ci("duckdb", "jupedsim", "csv")])
def test_a_limit_of_file_sizes_is_one_line(run_path: Path, to: str) -> None:
    """F19: SQLite reports a disk error of its own kind."""
    if to == "duckdb":
        pytest.importorskip("duckdb")
    limit = "import resource, signal; signal.signal(signal.SIGXFSZ, signal.SIG_IGN);"
    limit += "resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100));"
    done = process(limit + COMMAND, "export", run_path, "--to", to, "-o", run_path.with_name("out"))
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1), done.stderr
    assert done.stderr.startswith("stseg: error: ")
    assert sorted(path.name for path in run_path.parent.iterdir()) == ["left.avi", "night.h5"]


SIZE = (64, 48)


def test_a_million_digits_and_large_masks_take_no_time(tmp_path: Path) -> None:
    begun = time.monotonic()
    numbers = last_numbers(["a" + "9" * 1_000_000, "7" * 1_000_000 + "b"])
    assert numbers is not None and numbers.tolist() == [10**15 - 1, 777_777_777_777_777]
    assert time.monotonic() - begun < REFUSAL_TIME
    masks = [{"image_id": 0, "segmentation": {"size": [8000, 8000], "counts": [9, 63_999_991]}}] * 10_000
    (tmp_path / "r.json").write_text(json.dumps(masks))
    read_source(Source("boxes", tmp_path / "r.json"), SIZE)
    assert time.monotonic() - begun < REFUSAL_TIME
    assert run_lengths([8000, 8000], [9, 63_999_991]).box() == (0.0, 0.0, 8000.0, 8000.0)


@pytest.mark.parametrize("seed", range(20))
def test_the_box_of_run_lengths_is_that_of_the_mask(seed: int) -> None:
    mask = np.random.default_rng(seed).random((9, 7)) < (seed + 1) / 40
    edges = np.flatnonzero(np.diff(np.r_[0, mask.T.ravel(), 0]))
    own = RunLengths((7, 9), np.diff(np.r_[0, edges, mask.size]))
    v, u = np.nonzero(mask)
    expected = (u.min(), v.min(), np.ptp(u) + 1, np.ptp(v) + 1) if len(u) else (0, 0, 0, 0)
    np.testing.assert_array_equal(own.draw((7, 9)), mask)
    assert own.box() == expected


def test_a_parquet_file_of_many_rows_or_another_type_is_refused(tmp_path: Path) -> None:
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    path = tmp_path / "b.parquet"
    zeros = arrow.array(np.zeros(20_000_001, np.int8))
    names = ("frame", "left", "top", "width", "height")
    parquet.write_table(arrow.table(dict.fromkeys(names, zeros)), path, compression="zstd")
    assert path.stat().st_size < 1_000_000
    refused(FormatError, "rows, more than", read_source, Source("boxes", path), SIZE)
    parquet.write_table(arrow.table(dict.fromkeys(names, arrow.array([[1]]))), path)
    refused(FormatError, r"row 0: found frame \[1\]", read_source, Source("boxes", path), SIZE)


def test_boxes_far_beyond_the_image_become_no_masks() -> None:
    far = np.array([[-1e12, -1e12, 2e12, 2e12], [1e11, 5.0, 9.0, 9.0]])
    found = Detections(np.zeros(2, np.int64), far, np.ones(2))
    assert (instance_image(found, [0], SIZE) == 1).all() and not instance_image(found, [1], SIZE).any()
