"""Run files and arguments from strangers: a result, or one line that names them."""

import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from attacks import RIG, write_rig
from cases import cases
from recordings import COMMAND, ENVIRONMENT, in_ci
from refusals import Command, refused
from run_files import write_small_run

from stseg.errors import FormatError
from stseg.io.runfile.runs import read_run
from stseg.io.untrusted import safe_hdf5
from stseg.kernels.accelerate import COMPILED, kernel
from stseg.kernels.cache import KernelFolder


def spoil_column(file: h5py.File, table: str, column: str, value: float) -> None:
    rows = file[table][:]
    rows[column][0] = value
    file[table][...] = rows


SPOILED: dict[str, Callable[[h5py.File], object]] = {
    "fps 0": lambda file: file["trajectory"].attrs.__setitem__("fps", 0.0),
    "fps nan": lambda file: file["trajectory"].attrs.__setitem__("fps", np.nan),
    "fps 1e308": lambda file: file["trajectory"].attrs.__setitem__("fps", 1e308),
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
@pytest.mark.parametrize("to", ["jupedsim", *in_ci("geojson", "wildtrack", "mot-boxes", "mf-json")])
def test_run_paths_with_false_contents_are_refused(run_path: Path, refusal: Command, spoil: str, to: str) -> None:
    if spoil == "rig of other size" and to not in ("jupedsim", "wildtrack"):
        pytest.skip("this export needs no rig")
    with h5py.File(run_path, "r+") as file:
        SPOILED[spoil](file)
    output = run_path.with_name("out")
    refusal("export", run_path, "--to", to, "-o", output)
    assert not output.exists()


def test_a_run_path_shows_no_other_file(run_path: Path, tmp_path: Path, refusal: Command) -> None:
    secret = tmp_path / "secret"
    secret.write_bytes(b"secret words " * 100)
    with h5py.File(run_path, "r+") as file:
        del file["entry/title"]
        file.create_dataset("entry/title", (1,), "S64", external=[(str(secret), 0, 64)])
    said = refusal("inspect", run_path)
    assert "another file" in said and "secret words" not in said


@pytest.mark.parametrize("kind", ["external", "soft", "virtual"])
def test_links_out_of_a_run_path_are_refused(run_path: Path, tmp_path: Path, refusal: Command, kind: str) -> None:
    other = write_small_run(tmp_path / "other.h5")
    with h5py.File(run_path, "r+") as file:
        table = file["events"][:]
        del file["events"]
        if kind == "virtual":
            layout = h5py.VirtualLayout((len(table),), table.dtype)
            layout[:] = h5py.VirtualSource(str(other), "events", table.shape, table.dtype)
            file.create_virtual_dataset("events", layout)
        else:
            links = {"external": h5py.ExternalLink(str(other), "/events"), "soft": h5py.SoftLink("/boxes")}
            file["events"] = links[kind]
    refusal("inspect", run_path)


@pytest.mark.parametrize("command", ["review", "measure", "export --to geojson"])
@pytest.mark.parametrize("column", ["id", "first"])
def test_tracks_unlike_their_rows_are_refused(run_path: Path, refusal: Command, command: str, column: str) -> None:
    with h5py.File(run_path, "r+") as file:
        rows = file["tracks"][:]
        rows[column][0] = {"id": 90, "first": 0}[column]
        rows["last"][0] += column == "first"
        file["tracks"][...] = rows
    assert "/tra" in refusal(*command.split(), run_path, "-o", run_path.with_name("output.html"))


@pytest.mark.parametrize("name", ["label", "frame", "views"])
def test_whole_numbers_stored_as_floats_are_refused(run_path: Path, refusal: Command, name: str) -> None:
    with h5py.File(run_path, "r+") as file:
        group = file["entry/occupancy"]
        values = group[name][:].astype(float)
        del group[name]
        group[name] = values
    assert "found the type float64" in refusal("inspect", run_path)


def test_a_heap_that_never_ends_is_refused(run_path: Path, refusal: Command) -> None:
    """HDF5 walks on the spot where the free space of a global heap, object 0, has a false size."""
    contents = bytearray(run_path.read_bytes())
    start = contents.rindex(b"GCOL\x01\0\0\0")
    place = start + 16
    while contents[place : place + 2] != b"\0\0":
        place += 16 + -(-int.from_bytes(contents[place + 8 : place + 16], "little") // 8) * 8
    contents[place + 8 : place + 16] = (0).to_bytes(8, "little")
    run_path.write_bytes(contents)
    assert f"a global heap at byte {start}: 0 bytes free" in refusal("inspect", run_path)


@pytest.mark.parametrize("size", [0, 15, 2**62])
def test_a_heap_of_false_size_is_refused(run_path: Path, refusal: Command, size: int) -> None:
    contents = bytearray(run_path.read_bytes())
    start = contents.index(b"GCOL\x01\0\0\0")
    contents[start + 8 : start + 16] = size.to_bytes(8, "little")
    run_path.write_bytes(contents)
    assert f"a global heap at byte {start}" in refusal("inspect", run_path)


@pytest.mark.skipif(sys.platform != "linux", reason="memory is bounded there alone")
def test_a_text_of_2_gib_takes_no_such_memory(run_path: Path, refusal: Command) -> None:
    with h5py.File(run_path) as file:
        place = file["provenance/config"].id.get_offset()
    contents = bytearray(run_path.read_bytes())
    contents[place : place + 4] = (2**31 - 1).to_bytes(4, "little")
    run_path.write_bytes(contents)
    before = resource.getrlimit(resource.RLIMIT_AS)
    assert "allocation failed" in refusal("report", run_path, "-o", run_path.with_name("report.html"))
    assert resource.getrlimit(resource.RLIMIT_AS) == before


def test_heaps_are_found_astride_of_blocks(run_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    contents = run_path.read_bytes()
    expected = [place for place in range(len(contents)) if contents.startswith(b"GCOL\x01\0\0\0", place)]
    for block in (9, 100, 901):
        monkeypatch.setattr(safe_hdf5, "_BLOCK", block)
        with run_path.open("rb") as file:
            assert list(safe_hdf5._collections(file)) == expected


def test_a_file_is_examined_once_and_again_when_it_has_changed(run_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    examined: list[h5py.File] = []
    monkeypatch.setattr(safe_hdf5, "_require_own", examined.append)
    for _ in range(3):
        assert len(read_run(run_path).trajectory)
    assert len(examined) == 1
    with h5py.File(run_path, "r+") as file:
        file["another"] = h5py.ExternalLink("elsewhere.h5", "/")
    monkeypatch.undo()
    refused(FormatError, "a link that leads elsewhere", read_run, run_path)


@pytest.mark.parametrize(
    "frames", ["0:300000000", "0:9999999999999", "9" * 5000, "0:" + "9" * 5000, "\u0663:\u0665", "5:3"]
)
def test_ranges_of_frames_are_bounded(tmp_path: Path, run_path: Path, refusal: Command, frames: str) -> None:
    (tmp_path / "truth.csv").write_text("frame,id,x,y\n0,1,0,0\n")
    refusal("evaluate", run_path, tmp_path / "truth.csv", "--frames", frames)
    refusal("run", write_rig(tmp_path), "-o", tmp_path / "q.h5", "--frames", frames)


def test_twenty_thousand_people_in_a_frame_are_refused(tmp_path: Path, run_path: Path, refusal: Command) -> None:
    (tmp_path / "truth.csv").write_text("frame,id,x,y\n" + "".join(f"0,{k},0,0\n" for k in range(20_000)))
    assert "people in a frame" in refusal("evaluate", run_path, tmp_path / "truth.csv")


@pytest.mark.parametrize(
    "option",
    [("--seconds", "nan"), ("--frame-rate", "inf"), ("--size", "100000,100000"), ("--size", "9" * 5000 + ",1")],
)
def test_simulations_are_bounded(tmp_path: Path, refusal: Command, option: tuple[str, str]) -> None:
    refusal("simulate", tmp_path / "scene", "--scene", "tiny", *option)


@cases()
def test_any_standard_output_will_do(tmp_path: Path, shell: str, status: tuple[int, ...]) -> None:
    program = shell.replace("COMMAND", f"-c '{COMMAND}'")
    command = ["sh", "-c", program, sys.executable]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, env=ENVIRONMENT)
    assert done.returncode in status, done.stderr
    assert "Traceback" not in done.stderr and len(done.stderr.splitlines()) <= 1


def test_no_escape_codes_reach_the_terminal(tmp_path: Path, refusal: Command, stdout: Command) -> None:
    rig = write_rig(tmp_path)
    (tmp_path / "boxes.csv").write_text("frame,left,top,width,height,class\n0,1,1,5,9,\x1b[31m\n")
    assert r"\x1b[31m 1" in stdout("inspect", rig)
    refusal("run", tmp_path / "\x1b[31mred.toml", "-o", tmp_path / "q.h5")
    refusal("run", write_rig(tmp_path, 'name = "cam1"', 'name = "\\u001b[31m"'), "-o", tmp_path / "q.h5")


@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
def test_kernels_compile_without_a_place_for_their_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(KernelFolder, "from_function", lambda function, source: None)  # noqa: ARG005
    assert kernel(_double)(2.0) == 4.0


def _double(value: float) -> float:
    return 2 * value
