"""Run files of false contents (findings F9, F11 and F17) are refused, and show no other file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from attacks import RIG, refusal
from run_files import write_small_run

from stseg.io.runfile.runs import read_run


@pytest.fixture
def run_file(tmp_path: Path) -> Path:
    (tmp_path / "run").mkdir()
    return write_small_run(tmp_path / "run" / "night.h5")


def spoil_fps(file: h5py.File, value: float) -> None:
    file["trajectory"].attrs["fps"] = value


def spoil_column(file: h5py.File, table: str, column: str, value: float) -> None:
    rows = file[table][:]
    rows[column][0] = value
    file[table][...] = rows


SPOILED: dict[str, Callable[[h5py.File], object]] = {
    "fps 0": lambda file: spoil_fps(file, 0.0),
    "fps nan": lambda file: spoil_fps(file, np.nan),
    "fps 1e308": lambda file: spoil_fps(file, 1e308),
    "frame -1": lambda file: spoil_column(file, "trajectory", "frame", -1),
    "frame 2^62": lambda file: spoil_column(file, "trajectory", "frame", 2**62),
    "x nan": lambda file: spoil_column(file, "trajectory", "x", np.nan),
    "id of no track": lambda file: spoil_column(file, "trajectory", "id", 77),
    "10^12 rows": lambda file: file["trajectory"].resize((10**12,)),
    "kept 5": lambda file: file["entry/occupancy"].attrs.__setitem__("kept", 5),
    "no tracks": lambda file: file["tracks"].resize((0,)),
    "camera ..": lambda file: file.attrs.__setitem__("cameras", ["..", "../../evil"]),
    "rig of other size": lambda file: file["provenance/rig"].__setitem__((), RIG),
}


@pytest.mark.parametrize("spoil", SPOILED)
@pytest.mark.parametrize("to", ["jupedsim", "geojson", "wildtrack", "mot-boxes", "mf-json"])
def test_run_files_with_false_contents_are_refused(
    run_file: Path, capsys: pytest.CaptureFixture[str], spoil: str, to: str
) -> None:
    if spoil == "rig of other size" and to not in ("jupedsim", "wildtrack"):
        pytest.skip("this export needs no rig")
    with h5py.File(run_file, "r+") as file:
        SPOILED[spoil](file)
    output = run_file.with_name("out")
    refusal(capsys, "export", run_file, "--to", to, "-o", output)
    assert not output.exists()


def test_a_run_file_shows_no_other_file(run_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    secret = tmp_path / "secret"
    secret.write_bytes(b"secret words " * 100)
    with h5py.File(run_file, "r+") as file:
        del file["entry/title"]
        file.create_dataset("entry/title", (1,), "S64", external=[(str(secret), 0, 64)])
    said = refusal(capsys, "inspect", run_file)
    assert "another file" in said
    assert "secret words" not in said


@pytest.mark.parametrize("kind", ["external", "soft", "virtual"])
def test_links_out_of_a_run_file_are_refused(
    run_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str
) -> None:
    other = write_small_run(tmp_path / "other.h5")
    with h5py.File(run_file, "r+") as file:
        table = file["events"][:]
        del file["events"]
        if kind == "external":
            file["events"] = h5py.ExternalLink(str(other), "/events")
        elif kind == "soft":
            file["events"] = h5py.SoftLink("/boxes")
        else:
            layout = h5py.VirtualLayout((len(table),), table.dtype)
            if len(table):
                layout[:] = h5py.VirtualSource(str(other), "events", table.shape, table.dtype)
            file.create_virtual_dataset("events", layout)
    refusal(capsys, "inspect", run_file)


def test_a_run_file_is_still_read(run_file: Path) -> None:
    run = read_run(run_file)
    run.require_fit()
    assert len(run.trajectory)


@pytest.mark.parametrize("command", ["review", "measure", "export --to geojson"])
@pytest.mark.parametrize("column", ["id", "first"])
def test_tracks_that_are_not_those_of_the_rows_are_refused(
    run_file: Path, capsys: pytest.CaptureFixture[str], command: str, column: str
) -> None:
    with h5py.File(run_file, "r+") as file:
        rows = file["tracks"][:]
        rows[column][0] = {"id": 90, "first": 0}[column]
        rows["last"][0] += column == "first"
        file["tracks"][...] = rows
    said = refusal(capsys, *command.split(), run_file, "-o", run_file.with_name("output.html"))
    assert "/tra" in said


@pytest.mark.parametrize("name", ["label", "frame", "views"])
def test_whole_numbers_stored_as_floats_are_refused(
    run_file: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    with h5py.File(run_file, "r+") as file:
        group = file["entry/occupancy"]
        values = group[name][:].astype(float)
        del group[name]
        group[name] = values
    assert "found the type float64" in refusal(capsys, "inspect", run_file)
