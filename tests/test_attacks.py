"""Bad input and hostile files: each finding of the security study ends in a result or one line, and harms no file."""

from __future__ import annotations

import json
import os
import struct
import subprocess
import sys
import time
import zipfile
from collections.abc import Callable
from pathlib import Path

import cv2
import h5py
import numpy as np
import pytest
from run_files import write_small_run

from stseg.accelerate import COMPILED, kernel
from stseg.commands.main import main
from stseg.errors import InputError
from stseg.io.calibrations.matlab_file import parse_mat
from stseg.io.names import is_name
from stseg.io.numbers import parse_number, parse_whole
from stseg.io.numpy_files import parse_npy
from stseg.io.recording.rigs import parse_rig, read_rig
from stseg.io.recording.source_files import source_parts
from stseg.io.recording.video_size import read_video_size
from stseg.io.runfile.runs import read_run
from stseg.io.runfile.work_folder import WorkFolder

SECONDS = 10.0
"""Time within which any input is answered."""

RIG = """
format = 1
[scene]
name = "yard"
frame_rate = 10.0
x = [-2.0, 2.0]
y = [-2.0, 2.0]
[grid]
cell = 0.2
top = 1.8
planes = 4
[[camera]]
name = "cam1"
size = [64, 48]
ground = [[60.0, 32.0, 192.0], [0.0, 24.0, 324.0], [0.0, 1.0, 6.0]]
vertical = [0.0, -60.0, 0.0]
source = { kind = "boxes", path = "boxes.csv" }
"""


def refusal(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """The one line of a command that refuses its input in time."""
    begun = time.monotonic()
    status = main([str(argument) for argument in arguments])
    error = capsys.readouterr().err
    assert status == 2, error
    assert time.monotonic() - begun < SECONDS
    lines = [line for line in error.splitlines() if line]
    assert len(lines) == 1, error
    assert lines[0].startswith("stseg: error: ")
    assert lines[0].isprintable()
    return lines[0]


def write_rig(folder: Path, old: str = "", new: str = "") -> Path:
    assert old in RIG
    (folder / "boxes.csv").write_text("frame,left,top,width,height\n0,10,10,5,20\n3,11,10,5,20\n")
    (folder / "rig.toml").write_text(RIG.replace(old, new) if old else RIG)
    return folder / "rig.toml"


@pytest.fixture
def run_file(tmp_path: Path) -> Path:
    (tmp_path / "run").mkdir()
    return write_small_run(tmp_path / "run" / "night.h5")


# F1, F6: calibrations


def mat_file(name: bytes = b"P", rows: int = 3, columns: int = 4, size: int | None = None) -> bytes:
    values = np.arange(12, dtype="<f8").tobytes()
    flags = struct.pack("<IIII", 6, 8, 6, 0)
    sizes = struct.pack("<IIii", 5, 8, rows, columns)
    title = struct.pack("<HH4s", 1, len(name), name.ljust(4, b"\0"))
    body = flags + sizes + title + struct.pack("<II", 9, len(values)) + values
    return b"MATLAB".ljust(124) + b"\0\1IM" + struct.pack("<II", 14, len(body) if size is None else size) + body


def test_matlab_matrices_are_read_by_columns() -> None:
    np.testing.assert_array_equal(parse_mat(mat_file())["P"], np.arange(12.0).reshape(4, 3).T)


@pytest.mark.parametrize("seed", range(20))
def test_a_mutated_matlab_file_is_refused_or_read(seed: int) -> None:
    random, data = np.random.default_rng(seed), bytearray(mat_file())
    for place in random.integers(128, len(data), 8):
        data[place] = random.integers(256)
    try:
        matrices = parse_mat(bytes(data))
    except ValueError as error:
        assert "\n" not in str(error)
    else:
        assert all(matrix.ndim == 2 for matrix in matrices.values())


def test_a_matlab_file_that_declares_more_than_it_has_is_refused() -> None:
    with pytest.raises(ValueError, match=r"where .* are left"):
        parse_mat(mat_file(size=2**31))
    assert parse_mat(mat_file(rows=2**20, columns=2**20)) == {}


@pytest.mark.parametrize(
    "header",
    [
        "{'descr': '<f8', 'fortran_order': False, 'shape': (1000000, 1000000), }",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (3, ",
        "{'descr': '|O', 'fortran_order': False, 'shape': (3, 4), }",
        "(" * 200,
    ],
)
def test_numpy_headers_are_not_believed(header: str) -> None:
    data = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode() + b"\0" * 96
    with pytest.raises(ValueError, match="header"):
        parse_npy(data)


def test_a_small_archive_that_unpacks_to_gigabytes_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.npy", bytes(200_000_000))
    said = refusal(
        capsys, *("calibrate", "import", "matrix", tmp_path / "a.npz", "-o", tmp_path / "r.toml"),
        *("--area=0,0,1,1", "--frame-rate", "5", "--size", "64,48", "--names", "a"),
    )  # fmt: skip
    assert "unpacked" in said


NVIDIA = {
    "sensors": [
        {
            "id": "c",
            "cameraMatrix": np.eye(3, 4).tolist(),
            "attributes": [{"name": "frameWidth", "value": "9" * 5000}, {"name": "frameHeight", "value": "9"}],
        }
    ]
}


@pytest.mark.parametrize(
    ("format", "suffix", "text"),
    [
        ("nvidia", ".json", json.dumps(NVIDIA)),
        ("nvidia", ".json", json.dumps(NVIDIA).replace('"c"', "[[1]]")),
        ("nvidia", ".json", json.dumps(NVIDIA).replace('"frameWidth"', "[1]")),
        ("krt", ".json", json.dumps({"": {"K": [1.0] * 9, "RT": [1.0] * 12}})),
        ("krt", ".json", "[" * 100_000),
        ("anipose", ".toml", '[cam_0]\nname = "a"\nsize = [64, 48]\nmatrix = [[1e308,0,1],[0,1,1],[0,0,1]]\n'
         "distortions = [0]\nrotation = [1e308, 1e308, 0]\ntranslation = [1, 1, 1]\n"),
        ("tsai", ".xml", '<Camera name="a"><Geometry width="1" height="1" dpx="1e-300" dpy="1e-300"/>'
         '<Intrinsic focal="1e9" kappa1="1e9" cx="1" cy="1" sx="1"/>'
         '<Extrinsic tx="0" ty="0" tz="0" rx="0" ry="0" rz="0"/></Camera>'),
        ("matrix", ".txt", "1e999 " * 12),
    ],
)  # fmt: skip
def test_calibrations_are_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], format: str, suffix: str, text: str
) -> None:
    (tmp_path / f"a{suffix}").write_text(text)
    refusal(
        capsys, *("calibrate", "import", format, tmp_path / f"a{suffix}", "-o", tmp_path / "rig.toml"),
        *("--area=0,0,1,1", "--frame-rate", "5", "--unit", "m", "--up=+z"),
    )  # fmt: skip
    assert not (tmp_path / "rig.toml").exists()


# F2: files of others


@pytest.mark.parametrize("name", ["..", ".", "a/b", "a\\b", "a\0b", "", " a", "x" * 200, "\x1b[31m", "\u202e", "a\nb"])
def test_names_that_are_no_names_of_files_are_refused(name: str) -> None:
    assert not is_name(name)
    with pytest.raises(InputError):
        parse_rig(RIG.replace('"cam1"', json.dumps(name)), Path("rig.toml"))


@pytest.mark.parametrize("name", ["cam 1", "Ω", "2026-01-01T10:30:00", "<script>", "a.b"])
def test_unusual_names_work(name: str) -> None:
    assert parse_rig(RIG.replace('"cam1"', json.dumps(name)), Path("rig.toml")).rig.cameras[0].name == name


def test_a_foreign_folder_is_left_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig, folder = write_rig(tmp_path), tmp_path / "q.h5.segments"
    folder.mkdir()
    for name in ("thesis.txt", "begun.json", "segment-00000.h5"):
        (folder / name).write_text("precious")
    for more in ((), ("--frames", "5:3"), ("--overwrite",)):
        assert "did not make" in refusal(capsys, "run", rig, "-o", tmp_path / "q.h5", *more)
    assert {path.name: path.read_text() for path in folder.iterdir()} == dict.fromkeys(
        ("thesis.txt", "begun.json", "segment-00000.h5"), "precious"
    )


def test_a_work_folder_that_is_a_link_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "else").mkdir()
    with WorkFolder(tmp_path / "else" / "q.h5", {}) as work:
        (tmp_path / "q.h5.segments").symlink_to(work.path)
        refusal(capsys, "run", write_rig(tmp_path), "-o", tmp_path / "q.h5")
        assert work.begun


def test_our_folder_keeps_files_that_are_not_ours(tmp_path: Path) -> None:
    with WorkFolder(tmp_path / "q.h5", {}) as work:
        (work.path / "thesis.txt").write_text("precious")
        work.remove()
    assert (tmp_path / "q.h5.segments" / "thesis.txt").read_text() == "precious"
    with WorkFolder(tmp_path / "q.h5", {}) as work:
        (work.path / "thesis.txt").unlink()
        work.remove()
    assert not (tmp_path / "q.h5.segments").exists()


def test_links_and_files_beside_an_output_are_not_written_to(run_file: Path) -> None:
    target, link, plain = (run_file.with_name(name) for name in ("target", "t.csv.part", "u.csv.part"))
    target.write_text("precious")
    plain.write_text("precious")
    link.symlink_to(target)
    for name in ("t.csv", "u.csv"):
        assert main(["export", str(run_file), "--to", "csv", "-o", str(run_file.with_name(name))]) == 0
    assert (target.read_text(), plain.read_text(), link.is_symlink()) == ("precious", "precious", True)
    assert not run_file.with_name("t.csv").is_symlink()


# F3: state for resuming


@pytest.mark.parametrize("content", ["", "[]", "1", "null", "[" * 100_000, '{"config": []}', "\xff"])
def test_notes_of_another_form_are_refused(tmp_path: Path, content: str) -> None:
    with WorkFolder(tmp_path / "q.h5", {"config": {"a": 1}}) as work:
        (work.path / "begun.json").write_bytes(content.encode("latin-1"))
    with pytest.raises(InputError, match="delete the folder"), WorkFolder(tmp_path / "q.h5", {"config": {"a": 1}}):
        pass


def test_damaged_time_stamps_are_made_anew(tmp_path: Path) -> None:
    recording = read_rig(write_rig(tmp_path))
    with WorkFolder(tmp_path / "q.h5", {}) as work:
        from stseg.io.recording.stream_index import index_streams

        work.keep_streams(index_streams(recording))
        path = work.path / "streams.npz"
        whole = path.read_bytes()
        kept = work.streams(recording)
        assert kept is not None
        assert kept.length == 4
        path.write_bytes(b"")
        assert work.streams(recording) is None
        for place in range(0, len(whole), 3):
            damaged = bytearray(whole)
            damaged[place] ^= 1 << place % 8
            path.write_bytes(damaged)
            found = work.streams(recording)
            assert found is None or found.length == 4


# F4, F5, F7, F8: rigs


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("x = [-2.0, 2.0]\ny = [-2.0, 2.0]", "x = [0, 1e12]\ny = [0, 1e-6]"),
        ("x = [-2.0, 2.0]", "x = [0, 1e8]"),
        ("cell = 0.2", "cell = 0.00055"),
        ("cell = 0.2", "cell = 0.001"),
        ("planes = 4", "planes = 90_000_000"),
        ("planes = 4", f"planes = {'9' * 400}"),
        ("planes = 4", f"planes = {'9' * 5000}"),
        ("frame_rate = 10.0", "frame_rate = 1e308"),
        ("frame_rate = 10.0", "frame_rate = 1e-308"),
        ("size = [64, 48]", "size = [1e300, 1e300]"),
        ("size = [64, 48]", "size = [2147483648, 2147483648]"),
        ("size = [64, 48]", "size = [100000, 100000]"),
        ("source = {", f"offset = {'9' * 31}\nsource = {{"),
        ('path = "boxes.csv"', f'path = "boxes.csv", frames = {"9" * 31}'),
        ('path = "boxes.csv"', f'path = "{"x" * 300}"'),
        ('path = "boxes.csv"', 'path = "a\\u0000b"'),
        ('kind = "boxes", path = "boxes.csv"', 'kind = "masks", path = "/"'),
        (
            "source = {",
            "lens = { matrix = [[50.0,0,32],[0,50.0,24],[0,0,1]], distortion = [1e308, 1e308] }\nsource = {",
        ),
        ("[grid]", "polygon = [" + "[0.0, 0.0], " * 100_000 + "]\n[grid]"),
        ("[grid]", ".".join("a" * 200_000) + " = 1\n[grid]"),
        ("[grid]", "a = " + "[" * 100_000 + "\n[grid]"),
    ],
)
def test_rigs_beyond_the_limits_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], old: str, new: str
) -> None:
    refusal(capsys, "run", write_rig(tmp_path, old, new), "-o", tmp_path / "q.h5")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["boxes.csv", "rig.toml"]


def test_three_thousand_cameras_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    camera = RIG[RIG.index("[[camera]]") :]
    cameras = "".join(camera.replace("cam1", f"cam{k}") for k in range(3000))
    path = write_rig(tmp_path)
    path.write_text(RIG[: RIG.index("[[camera]]")] + cameras)
    assert "at most 256" in refusal(capsys, "run", path, "-o", tmp_path / "q.h5")


def test_a_polygon_of_a_thousand_corners_works(tmp_path: Path) -> None:
    turn = np.linspace(0, 2 * np.pi, 1000, endpoint=False)
    corners = np.stack([1.5 * np.cos(turn), 1.5 * np.sin(turn)], -1).tolist()
    grid = read_rig(write_rig(tmp_path, "[grid]", f"polygon = {corners}\n[grid]")).rig.grid
    near = np.hypot(*np.moveaxis(grid.ground, -1, 0)) < 1.5
    np.testing.assert_array_equal(grid.inside(), near)


@pytest.mark.parametrize(
    "rows",
    ["2000000000,1,1,5,5", "0,1e999,1,5,5", "0,1,1,1e300,5", "0,1,1,-5,5", f"{'9' * 5000},1,1,5,5", "\u0663,1,1,5,5"],
)
def test_boxes_beyond_the_limits_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str], rows: str) -> None:
    rig = write_rig(tmp_path)
    (tmp_path / "boxes.csv").write_text(f"frame,left,top,width,height\n{rows}\n")
    refusal(capsys, "run", rig, "-o", tmp_path / "q.h5")


def test_a_hundred_thousand_boxes_in_a_frame_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig = write_rig(tmp_path)
    (tmp_path / "boxes.csv").write_text("frame,left,top,width,height\n" + "0,1,1,5,5\n" * 100_000)
    assert "boxes in" in refusal(capsys, "run", rig, "-o", tmp_path / "q.h5")


def test_a_file_with_a_superscript_in_its_name_is_ordered(tmp_path: Path) -> None:
    recording = read_rig(write_rig(tmp_path, 'kind = "boxes", path = "boxes.csv"', 'kind = "video", path = "a*.avi"'))
    for name in ("a1²2.avi", "a10²2.avi", "a9²2.avi"):
        (tmp_path / name).write_bytes(b"\0")
    parts = source_parts(recording.sources[0].source, "")
    assert [part.path.name for part in parts] == ["a1²2.avi", "a9²2.avi", "a10²2.avi"]


@pytest.mark.parametrize("points", [300_000])
def test_hundreds_of_thousands_of_points_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], points: int
) -> None:
    (tmp_path / "p.csv").write_text("camera,u,v,x,y\n" + "cam1,1,1,1,1\n" * points)
    refusal(
        capsys, *("calibrate", "points", tmp_path / "p.csv", "-o", tmp_path / "r.toml", "--area=0,0,1,1"),
        *("--frame-rate", "5", "--size", "64,48"),
    )  # fmt: skip


# F5, F15, F16: the command line


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


# F9, F11: run files


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


# F10: recordings with a colon; F13: paths that are no UTF-8


def film(path: Path, plain: Path) -> None:
    """A film of three frames; OpenCV writes it under a plain name."""
    writer = cv2.VideoWriter(str(plain), cv2.VideoWriter.fourcc(*"MJPG"), 10, (64, 48))
    for _ in range(3):
        writer.write(np.zeros((48, 64, 3), np.uint8))
    writer.release()
    plain.rename(path)


@pytest.mark.parametrize("name", ["2026-01-01T10:30:00.avi", "http:127.0.0.1:9701", "concat:a", "-", "a%03d.avi"])
def test_any_name_of_a_file_is_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    film(tmp_path / name, tmp_path / "plain.avi")
    monkeypatch.chdir(tmp_path)
    assert read_video_size(Path(name)) == (64, 48)


@pytest.mark.skipif(sys.platform != "linux", reason="needs file names of any bytes")
def test_paths_that_are_no_utf8_work(tmp_path: Path) -> None:
    folder = Path(os.fsdecode(os.fsencode(tmp_path) + b"/\xff\xfe"))
    folder.mkdir()
    film(folder / "a.avi", tmp_path / "plain.avi")
    assert read_video_size(folder / "a.avi") == (64, 48)
    assert read_rig(write_rig(folder)).rig.name == "yard"


@pytest.mark.parametrize(
    "text", ["#EXTM3U\n#EXTINF:1,\nhttp://127.0.0.1:9/a.ts\n", "ffconcat version 1.0\nfile a.avi\n"]
)
def test_playlists_are_no_videos(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.avi").write_text(text)
    with pytest.raises(InputError, match="playlist"):
        read_video_size(tmp_path / "a.avi")


def test_pipes_are_not_waited_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig = write_rig(tmp_path)
    (tmp_path / "boxes.csv").unlink()
    os.mkfifo(tmp_path / "boxes.csv")
    refusal(capsys, "run", rig, "-o", tmp_path / "q.h5")


# F12, F18: the terminal


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
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[1])},
    )  # fmt: skip
    assert done.returncode in status, done.stderr
    assert "Traceback" not in done.stderr
    assert len(done.stderr.splitlines()) <= 1


def test_no_escape_codes_reach_the_terminal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    refusal(capsys, "run", tmp_path / "\x1b[31mred.toml", "-o", tmp_path / "q.h5")
    refusal(capsys, "run", write_rig(tmp_path, 'name = "cam1"', 'name = "\\u001b[31m"'), "-o", tmp_path / "q.h5")


# F20: a recording that changed


def test_a_recording_that_changed_in_place_is_noticed(tmp_path: Path) -> None:
    from stseg.io.runfile.provenance import gather_provenance, run_request

    recording, path = read_rig(write_rig(tmp_path)), tmp_path / "boxes.csv"
    before, state = run_request(recording, gather_provenance(recording, "")), path.stat()
    path.write_text(path.read_text().replace("3,11", "3,12"))
    os.utime(path, ns=(state.st_atime_ns, state.st_mtime_ns))
    assert run_request(recording, gather_provenance(recording, "")) != before


# A home and a package that cannot be written


@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
def test_kernels_compile_without_a_place_for_their_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    import numba.core.caching

    monkeypatch.setattr(numba.core.caching.CompileResultCacheImpl, "_locator_classes", [])
    assert kernel(_double)(2.0) == 4.0


def _double(value: float) -> float:
    return 2 * value


# Numbers


@pytest.mark.parametrize("text", ["1_000", "٣", "inf", "nan", "1e999", "0x1", "", " ", "1" * 500, "1e", "--1"])
def test_what_is_no_number(text: str) -> None:
    assert np.isnan(parse_number(text))


@pytest.mark.parametrize("text", ["1", " -1.5 ", "+.5", "5.", "1e-3", "1E5"])
def test_numbers_are_read_as_python_reads_them(text: str) -> None:
    assert parse_number(text) == float(text)


def test_whole_numbers_are_within_their_range() -> None:
    assert parse_whole("7", 0, 9) == 7
    assert parse_whole("10", 0, 9) is None
    assert parse_whole("1" * 5000, 0, 9) is None


def test_a_run_file_is_still_read(run_file: Path) -> None:
    run = read_run(run_file)
    run.require_fit()
    assert len(run.trajectory)
