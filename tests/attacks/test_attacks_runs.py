"""Run files and arguments from strangers: a result, or one line that names them."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from attacks import RIG, refusal, write_rig
from run_files import write_small_run

from stseg.errors import FormatError
from stseg.io.runfile.runs import read_run
from stseg.io.untrusted import safe_hdf5
from stseg.kernels.accelerate import COMPILED, kernel
from stseg.kernels.cache import KernelFolder


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


def test_a_heap_that_never_ends_is_refused(run_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """HDF5 walks on the spot where the free space of a global heap, object 0, has a false size."""
    contents = bytearray(run_file.read_bytes())
    start = contents.rindex(b"GCOL\x01\0\0\0")
    place = start + 16
    while contents[place : place + 2] != b"\0\0":
        place += 16 + -(-int.from_bytes(contents[place + 8 : place + 16], "little") // 8) * 8
    contents[place + 8 : place + 16] = (0).to_bytes(8, "little")
    run_file.write_bytes(contents)
    assert f"a global heap at byte {start}: 0 bytes free" in refusal(capsys, "inspect", run_file)


@pytest.mark.parametrize("size", [0, 15, 2**62])
def test_a_heap_of_false_size_is_refused(run_file: Path, capsys: pytest.CaptureFixture[str], size: int) -> None:
    contents = bytearray(run_file.read_bytes())
    start = contents.index(b"GCOL\x01\0\0\0")
    contents[start + 8 : start + 16] = size.to_bytes(8, "little")
    run_file.write_bytes(contents)
    assert f"a global heap at byte {start}" in refusal(capsys, "inspect", run_file)


@pytest.mark.skipif(sys.platform != "linux", reason="memory is bounded there alone")
def test_a_text_of_2_gib_takes_no_such_memory(run_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with h5py.File(run_file) as file:
        place = file["provenance/config"].id.get_offset()
    contents = bytearray(run_file.read_bytes())
    contents[place : place + 4] = (2**31 - 1).to_bytes(4, "little")
    run_file.write_bytes(contents)
    before = resource.getrlimit(resource.RLIMIT_AS)
    assert "allocation failed" in refusal(capsys, "report", run_file, "-o", run_file.with_name("report.html"))
    assert resource.getrlimit(resource.RLIMIT_AS) == before


def test_heaps_are_found_astride_of_blocks(run_file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    contents = run_file.read_bytes()
    expected = [place for place in range(len(contents)) if contents.startswith(b"GCOL\x01\0\0\0", place)]
    for block in (9, 100, 901):
        monkeypatch.setattr(safe_hdf5, "_BLOCK", block)
        with run_file.open("rb") as file:
            assert list(safe_hdf5._collections(file)) == expected


def test_a_file_is_examined_once_and_again_when_it_has_changed(run_file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    examined: list[h5py.File] = []
    monkeypatch.setattr(safe_hdf5, "_require_own", examined.append)
    for _ in range(3):
        assert len(read_run(run_file).trajectory)
    assert len(examined) == 1
    with h5py.File(run_file, "r+") as file:
        file["another"] = h5py.ExternalLink("elsewhere.h5", "/")
    monkeypatch.undo()
    with pytest.raises(FormatError, match="a link that leads elsewhere"):
        read_run(run_file)


# Commands


@pytest.mark.parametrize(
    "frames", ["0:300000000", "0:9999999999999", "9" * 5000, "0:" + "9" * 5000, "\u0663:\u0665", "5:3"]
)
def test_ranges_of_frames_are_bounded(
    tmp_path: Path, run_file: Path, capsys: pytest.CaptureFixture[str], frames: str
) -> None:
    (tmp_path / "truth.csv").write_text("frame,id,x,y\n0,1,0,0\n")
    refusal(capsys, "evaluate", run_file, tmp_path / "truth.csv", "--frames", frames)
    refusal(capsys, "run", write_rig(tmp_path), "-o", tmp_path / "q.h5", "--frames", frames)


def test_twenty_thousand_people_in_a_frame_are_refused(
    tmp_path: Path, run_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "truth.csv").write_text("frame,id,x,y\n" + "".join(f"0,{k},0,0\n" for k in range(20_000)))
    assert "people in a frame" in refusal(capsys, "evaluate", run_file, tmp_path / "truth.csv")


@pytest.mark.parametrize(
    "option",
    [("--seconds", "nan"), ("--frame-rate", "inf"), ("--size", "100000,100000"), ("--size", "9" * 5000 + ",1")],
)
def test_simulations_are_bounded(tmp_path: Path, capsys: pytest.CaptureFixture[str], option: tuple[str, str]) -> None:
    refusal(capsys, "simulate", tmp_path / "scene", "--scene", "tiny", *option)


@pytest.mark.parametrize(
    ("shell", "status"),
    [
        ('"$0" -m stseg.commands.main --help >&-', (0, 2)),
        ('"$0" -m stseg.commands.main --help >/dev/full', (2,)),
        ('PYTHONIOENCODING=ascii "$0" -m stseg.commands.main run "Ω.toml" -o q.h5', (2,)),
    ],
)
def test_any_standard_output_will_do(tmp_path: Path, shell: str, status: tuple[int, ...]) -> None:
    program = shell.replace(
        "-m stseg.commands.main", "-c 'import sys; from stseg.commands.main import main; sys.exit(main())'"
    )
    done = subprocess.run(
        ["sh", "-c", program, sys.executable], cwd=tmp_path, capture_output=True, text=True, check=False,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])},
    )  # fmt: skip
    assert done.returncode in status, done.stderr
    assert "Traceback" not in done.stderr
    assert len(done.stderr.splitlines()) <= 1


def test_no_escape_codes_reach_the_terminal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    refusal(capsys, "run", tmp_path / "\x1b[31mred.toml", "-o", tmp_path / "q.h5")
    refusal(capsys, "run", write_rig(tmp_path, 'name = "cam1"', 'name = "\\u001b[31m"'), "-o", tmp_path / "q.h5")


@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
def test_kernels_compile_without_a_place_for_their_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(KernelFolder, "from_function", lambda function, source: None)  # noqa: ARG005
    assert kernel(_double)(2.0) == 4.0


def _double(value: float) -> float:
    return 2 * value
