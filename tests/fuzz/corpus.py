"""Valid files that fuzzing begins with: texts lie in the folder `files`, named as their targets; others are made."""

import struct
from collections.abc import Callable
from contextlib import redirect_stdout
from importlib import import_module
from io import StringIO
from pathlib import Path

import cv2
import h5py
import numpy as np
from films import write_at_rate
from run_files import write_small_run

from stseg.arrays import AnyArray
from stseg.commands.correct import correct
from stseg.io.outputs.whole_files import replacing
from stseg.io.recording.aligned_stream import index_streams
from stseg.io.recording.pictures import encode_indexed
from stseg.io.recording.rigs import read_recording
from stseg.io.runfile.unfinished.work_folder import WorkFolder

Maker = Callable[[Path], bytes]
"""Makes a valid file; the folder is one to work in."""
_MATRIX = np.arange(12.0).reshape(3, 4)
_NUMBERS = np.arange(64 * 48, dtype=np.uint8).reshape(48, 64) % 7
GREY = np.full((48, 64, 3), 90, np.uint8)
RAMP = (np.arange(64 * 48 * 3, dtype=np.uint32).reshape(48, 64, 3) % 251).astype(np.uint8)


def text(name: str) -> bytes:
    return (Path(__file__).parent / "files" / name).read_bytes()


def mat_file(rows: int = 3, columns: int = 4, size: int | None = None) -> bytes:
    """A MATLAB file of version 5 with a 3x4 matrix; it may declare another shape, and another size of its content."""
    values = _MATRIX.astype("<f8").tobytes()
    head = struct.pack("<6I2i2H4s", 6, 8, 6, 0, 5, 8, rows, columns, 1, 1, b"P\0\0\0")
    body = head + struct.pack("<II", 9, len(values)) + values
    return b"MATLAB".ljust(124) + b"\0\1IM" + struct.pack("<II", 14, len(body) if size is None else size) + body


def npy(folder: Path) -> bytes:
    np.save(folder / "p.npy", _MATRIX)
    return (folder / "p.npy").read_bytes()


def npz(folder: Path) -> bytes:
    np.savez_compressed(folder / "p.npz", files=np.array([1], np.int64), times0_0=np.arange(9.0), P=_MATRIX)
    return (folder / "p.npz").read_bytes()


def streams(folder: Path) -> bytes:
    """The index of a recording that is being tracked."""
    (folder / "rig.toml").write_bytes(text("rig.toml"))
    (folder / "boxes.csv").write_bytes(text("boxes.csv"))
    with WorkFolder(folder / "s.h5", {}) as work:
        work.keep_streams(index_streams(read_recording(folder / "rig.toml")))
        return (work.path / "streams.npz").read_bytes()


def matlab_hdf5(folder: Path) -> bytes:
    with replacing(folder / "p.mat", overwrite=True) as part, h5py.File(part, "w") as file:
        file["P"] = np.arange(12.0).reshape(4, 3)
    return (folder / "p.mat").read_bytes()


def indexed_png(_: Path) -> bytes:
    return encode_indexed(_NUMBERS, np.zeros((256, 3), np.uint8))


def encoded(suffix: str, picture: AnyArray) -> Maker:
    return lambda _: bytes(cv2.imencode(suffix, picture)[1])


grey_png = encoded(".png", _NUMBERS.astype(np.uint16))


def video(suffix: str, codec: str) -> Maker:
    """Four frames that grow brighter."""
    frames = [np.full((48, 64, 3), 20 * frame, np.uint8) for frame in range(4)]
    return lambda folder: write_at_rate(folder / f"film{suffix}", frames, codec=codec).read_bytes()


def parquet(folder: Path) -> bytes:
    arrow, tables = import_module("pyarrow"), import_module("pyarrow.parquet")
    columns = {"frame": [0, 3], "left": [1.0, 2.0], "top": [2, 3], "width": [9, 9], "height": [20, 21]}
    tables.write_table(arrow.table(columns | {"label": ["a", "b"]}), folder / "boxes.parquet")
    return (folder / "boxes.parquet").read_bytes()


def small_run(folder: Path) -> bytes:
    """A run with names."""
    answers, output = folder / "answers.csv", folder / "corrected.h5"
    answers.write_bytes(text("answers.csv"))
    with redirect_stdout(StringIO()):
        correct(write_small_run(folder / "small.h5", overwrite=True), answers, output=output, overwrite=True)
    return output.read_bytes()
