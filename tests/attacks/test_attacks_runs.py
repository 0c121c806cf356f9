"""Run files and arguments from strangers: a result, or one line that names them."""

import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import h5py
import pytest
from attacks import RIG, write_rig
from checks import Command, cases, in_ci, refused
from recordings import COMMAND, ENVIRONMENT
from run_files import write_small_run

from stseg.errors import FormatError
from stseg.io.runfile.runs import read_run
from stseg.io.untrusted import safe_hdf5
from stseg.kernels.accelerate import COMPILED, kernel
from stseg.kernels.cache import KernelFolder

SPOILED: dict[str, Callable[[h5py.File], object]] = {
    "10^12 rows": lambda file: file["trajectory"].resize((10**12,)),
    "no tracks": lambda file: file["tracks"].resize((0,)),
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


@pytest.mark.parametrize("size", [None, 0, 15, 2**62])
def test_a_heap_that_never_ends_is_refused(run_path: Path, refusal: Command, size: int | None) -> None:
    """HDF5 walks on the spot where a global heap, or its free space, object 0, has a false size."""
    contents = bytearray(run_path.read_bytes())
    start = contents.rindex(b"GCOL\x01\0\0\0")
    place = start + 16
    while contents[place : place + 2] != b"\0\0":
        place += 16 + -(-int.from_bytes(contents[place + 8 : place + 16], "little") // 8) * 8
    place = start if size is not None else place
    contents[place + 8 : place + 16] = (size or 0).to_bytes(8, "little")
    run_path.write_bytes(contents)
    assert f"a global heap at byte {start}{': 0 bytes free' * (size is None)}" in refusal("inspect", run_path)


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


def test_heaps_are_found_and_files_examined_when_changed(run_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    contents = run_path.read_bytes()
    expected = [place for place in range(len(contents)) if contents.startswith(b"GCOL\x01\0\0\0", place)]
    for block in (9, 100, 901):
        monkeypatch.setattr(safe_hdf5, "_BLOCK", block)
        with run_path.open("rb") as file:
            assert list(safe_hdf5._collections(file)) == expected
    examined: list[h5py.File] = []
    monkeypatch.setattr(safe_hdf5, "_require_own", examined.append)
    for _ in range(3):
        assert len(read_run(run_path).trajectory)
    assert len(examined) == 1
    with h5py.File(run_path, "r+") as file:
        file["another"] = h5py.ExternalLink("elsewhere.h5", "/")
    monkeypatch.undo()
    refused(FormatError, "a link that leads elsewhere", read_run, run_path)


@pytest.mark.parametrize("frames", ["0:300000000", "9" * 5000, "0:" + "9" * 5000, "\u0663:\u0665", "5:3"])
def test_ranges_of_frames_are_bounded(tmp_path: Path, run_path: Path, refusal: Command, frames: str) -> None:
    (tmp_path / "truth.csv").write_text("frame,id,x,y\n0,1,0,0\n")
    refusal("evaluate", run_path, tmp_path / "truth.csv", "--frames", frames)
    refusal("run", write_rig(tmp_path), "-o", tmp_path / "q.h5", "--frames", frames)


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
