"""Hostile calibrations (findings F1 and F6 of the security study) are read or refused in one line."""

from __future__ import annotations

import json
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest
from attacks import refusal

from stseg.io.calibrations.matlab_file import parse_mat
from stseg.io.untrusted.numpy_files import parse_npy


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
        "{'descr': '<b8', 'fortran_order': False, 'shape': (3, 4), }",
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
