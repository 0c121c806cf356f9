"""Valid files that fuzzing begins with: texts lie in the folder `files`, named as their targets; others are made."""

from __future__ import annotations

import struct
from collections.abc import Callable
from contextlib import redirect_stdout
from importlib import import_module
from io import BytesIO, StringIO
from pathlib import Path

import cv2
import h5py
import numpy as np
from run_files import write_small_run

from stseg.arrays import AnyArray
from stseg.commands.correct import correct
from stseg.io.outputs.whole_files import replacing
from stseg.io.recording.pictures import encode_indexed

Maker = Callable[[Path], bytes]
"""Makes a valid file; the folder is one to work in."""
_MATRIX = np.arange(12.0).reshape(3, 4)
_NUMBERS = np.arange(64 * 48, dtype=np.uint8).reshape(48, 64) % 7
GREY = np.full((48, 64, 3), 90, np.uint8)
RAMP = (np.arange(64 * 48 * 3, dtype=np.uint32).reshape(48, 64, 3) % 251).astype(np.uint8)


def text(name: str) -> bytes:
    """The file of that name."""
    return (Path(__file__).parent / "files" / name).read_bytes()


def mat(_: Path) -> bytes:
    """A MATLAB file of version 5 with a 3x4 matrix."""
    values = _MATRIX.astype("<f8").tobytes()
    head = struct.pack("<IIII", 6, 8, 6, 0) + struct.pack("<IIii", 5, 8, 3, 4) + struct.pack("<HH4s", 1, 1, b"P\0\0\0")
    body = head + struct.pack("<II", 9, len(values)) + values
    return b"MATLAB".ljust(124) + b"\0\1IM" + struct.pack("<II", 14, len(body)) + body


def npy(_: Path) -> bytes:
    file = BytesIO()
    np.save(file, _MATRIX)
    return file.getvalue()


def npz(_: Path) -> bytes:
    file = BytesIO()
    np.savez_compressed(file, files=np.array([1], np.int64), times0_0=np.arange(9.0), P=_MATRIX)
    return file.getvalue()


def matlab_hdf5(folder: Path) -> bytes:
    with replacing(folder / "p.mat", overwrite=True) as part, h5py.File(part, "w") as file:
        file["P"] = np.arange(12.0).reshape(4, 3)
    return (folder / "p.mat").read_bytes()


def indexed_png(_: Path) -> bytes:
    return encode_indexed(_NUMBERS, np.zeros((256, 3), np.uint8))


def grey_png(folder: Path) -> bytes:
    return encoded(".png", _NUMBERS.astype(np.uint16))(folder)


def encoded(suffix: str, picture: AnyArray) -> Maker:
    return lambda _: bytes(cv2.imencode(suffix, picture)[1])


def video(suffix: str, codec: str) -> Maker:
    """Four frames that grow brighter."""

    def make(folder: Path) -> bytes:
        writer = cv2.VideoWriter(str(folder / f"film{suffix}"), cv2.VideoWriter.fourcc(*codec), 10, (64, 48))
        for frame in range(4):
            writer.write(np.full((48, 64, 3), 20 * frame, np.uint8))
        writer.release()
        return (folder / f"film{suffix}").read_bytes()

    return make


def parquet(folder: Path) -> bytes:
    """Boxes in Parquet."""
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
