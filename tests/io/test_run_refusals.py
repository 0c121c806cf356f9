"""What readers of run files and of unfinished ones refuse: the object, what was found, in one line."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from attacks import write_rig
from refusals import refused

from stseg.errors import FormatError
from stseg.io.recording.rigs import read_recording
from stseg.io.runfile.corrected import write_corrected
from stseg.io.runfile.runs import read_run
from stseg.io.runfile.unfinished.work_files import read_stream_times
from stseg.io.untrusted import limits
from stseg.io.untrusted.numpy_files import parse_npy, read_npz
from stseg.records.tables import ANSWER, Tracks
from stseg.tasks.correction import answered_before


def put(file: h5py.File, name: str, value: Any, **keys: Any) -> None:
    """An object in place of another; an attribute is `object@name`."""
    name, _, attribute = name.partition("@")
    if attribute:
        file[name].attrs[attribute] = value
        return
    rate = file[name].attrs.get("fps", 1.0) if name in file else 1.0
    if name in file:
        del file[name]
    file.create_dataset(name, data=value, **keys).attrs["fps"] = rate


CELLS = np.zeros((6, 3, 4, 6), "i4")
GROWING = {"maxshape": (None, 3, 4, 6), "chunks": (65, 3, 4, 6)}
LONG = "x" * 9999


@pytest.mark.parametrize(
    ("name", "value", "part", "message"),
    [
        ("/provenance/names", ["0,Ann"], "names", "names of tracks other than id,name"),
        ("/provenance/names", ["1,"], "names", "names of tracks other than id,name"),
        ("/provenance/sources", np.zeros(3), "provenance", "sources of another form"),
        ("/provenance/config", 5, "provenance", "."),
        ("/provenance/config", ["a", "b"], "provenance", "/provenance/config: no text"),
        ("/provenance/versions", ["a", "b"], "provenance", "/provenance/versions: values of type object"),
        ("/provenance/shown/0", np.zeros(3), "provenance", "shown of camera left: no frames by tick"),
        ("/provenance/shown/0", np.zeros((3, 3), int), "provenance", "shown of camera left: no frames by tick"),
        ("/provenance/shown/0", [-2], "provenance", "shown of camera left: no frames by tick"),
        ("/trajectory", "twice", "trajectory", "/trajectory: found a track twice in a frame"),
        ("/entry/occupancy/frame", [10, 11, 12, 13, 14, 17], "require_fit", "/trajectory, frame: found frame 15"),
        ("/entry/occupancy/frame", [10, 11, 12, 13, 14, 14], "frames", "frame: found numbers that do not rise"),
        ("/tracks", "twice", "require_fit", "/tracks: found a track that ends before it begins, or twice"),
        ("/entry/occupancy/x", np.full(6, np.inf), "frames", "occupancy/x: found a coordinate that is not finite"),
        ("/entry/occupancy/label", GROWING, "frames", r"label: frames of \(3, 4, 6\) in chunks of \(65, 3, 4, 6\)"),
        ("/entry/occupancy/views", np.zeros(9**5, "u1"), "frames", "."),
        ("/entry/occupancy@kept", LONG, "frames", "occupancy@kept: found 'xxx.*, expected one of all, tracks, none"),
        ("/trajectory@fps", LONG, "frames", "trajectory@fps: found 'xxx"),
        ("/@cameras", [LONG], "frames", "/@cameras: found .'xxx"),
    ],
)  # fmt: skip
def test_objects_are_refused(run_path: Path, name: str, value: Any, part: str, message: str) -> None:
    with h5py.File(run_path, "r+") as file:
        if value is GROWING:
            put(file, name, CELLS, **GROWING)
        else:
            put(file, name, np.repeat(file[name][:], 2) if isinstance(value, str) and value == "twice" else value)
        if "shown" in name:
            file[name].attrs["camera"] = "left"

    def read() -> object:
        found = getattr(read_run(run_path), part)
        return found() if callable(found) else found

    said = refused(FormatError, message, read)
    assert said.isprintable() and len(said) < 600 + len(str(run_path))


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("/boxes", None, "/boxes: found a table of fixed size"),
        ("/entry/occupancy/label", -1, "label: found labels that are no ids"),
        ("/answers", np.array([(1, 0, 0)], ANSWER), "/answers: found a row after its other"),
    ],
)
def test_runs_that_cannot_be_corrected_are_refused(run_path: Path, name: str, value: Any, message: str) -> None:
    with h5py.File(run_path, "r+") as file:
        put(file, "/committed", file["trajectory"][[0, -1]])
        if isinstance(value, int):
            file[name][0, 0, 0, 1] = value
        else:
            put(file, name, file[name][:] if value is None else value)
    run = read_run(run_path)

    def correct() -> None:
        rows = answered_before(run).table
        tracks = Tracks(run.trajectory, run.boxes, run.events)
        write_corrected(run_path, run_path.with_name("n.h5"), tracks, rows, lambda old, _: old, {}, "", False)

    refused(FormatError, message, correct)
    assert not run_path.with_name("n.h5").exists()


def test_titles_print_without_escape_codes(run_path: Path) -> None:
    with h5py.File(run_path, "r+") as file:
        put(file, "/entry/title", "\x1b[31m")
        put(file, "/provenance@created", "\x1b[31m")
    run = read_run(run_path)
    assert (run.scene, run.provenance.created) == (r"\x1b[31m", r"\x1b[31m")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda file: file.create_group("a/b/c/d/e/f/g/h/i/j"), "i/j: more than 10000 objects, or groups nested too"),
        (lambda file: file.create_dataset("x", (9,), "u1", compression="lzf"), r"/x: packed with filters \[32000\]"),
        (lambda file: file.create_dataset("x", (1 << 30,), "u1", chunks=(1 << 30,)), "/x: chunks of 1073741824 bytes"),
    ],
)
def test_structures_of_hdf5_are_refused(run_path: Path, make: Callable[[h5py.File], object], message: str) -> None:
    with h5py.File(run_path, "r+") as file:
        make(file)
    refused(FormatError, message, read_run, run_path)


def test_short_addresses_of_hdf5_are_refused(tmp_path: Path) -> None:
    properties = h5py.h5p.create(h5py.h5p.FILE_CREATE)
    properties.set_sizes(4, 4)
    h5py.h5f.create(bytes(tmp_path / "a.h5"), fcpl=properties).close()
    refused(FormatError, r"addresses and lengths of \(4, 4\) bytes", read_run, tmp_path / "a.h5")


NOW, COUNT = np.arange(4.0), np.array([4])


@pytest.mark.parametrize(
    "stored",
    [
        {"times0_0": NOW},
        {"files": COUNT[:0], "times0_0": NOW},
        {"files": np.ones(1), "times0_0": NOW},
        {"files": np.ones(257, int), "times0_0": NOW},
        {"files": np.ones(1, int)},
        {"files": np.ones(1, int), "times0_0": NOW.astype("f4")},
        {"files": np.ones(1, int), "times0_0": NOW[:, None]},
        {"files": np.ones(1, int), "times0_0": np.array([-1])},
        {"files": np.ones(1, int), "times0_0": np.array([limits.FRAMES + 1])},
    ],
)
def test_stored_time_stamps_are_refused(tmp_path: Path, stored: dict[str, np.ndarray]) -> None:
    recording = read_recording(write_rig(tmp_path))
    np.savez(tmp_path / "streams.npz", files=np.ones(1, int), times0_0=COUNT)
    kept = read_stream_times(tmp_path / "streams.npz", recording)
    assert kept is not None and kept.length == 4
    np.savez(tmp_path / "streams.npz", **stored)  # type: ignore[arg-type]
    assert read_stream_times(tmp_path / "streams.npz", recording) is None


def test_archives_of_many_members_or_axes_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    np.savez(tmp_path / "a.npz", a=NOW, b=NOW)
    np.save(tmp_path / "a.npy", np.zeros((1,) * 9))
    refused(ValueError, r"a .npy header of shape \(1, 1", parse_npy, (tmp_path / "a.npy").read_bytes())
    monkeypatch.setattr(limits, "MEMBERS", 1)
    refused(ValueError, "2 members, more than 1", read_npz, tmp_path / "a.npz")
