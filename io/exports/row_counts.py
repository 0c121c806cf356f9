"""Rows of an export, counted in the written file before it gets its name."""

import json
import sqlite3
from collections.abc import Callable, Mapping
from contextlib import closing
from functools import partial
from pathlib import Path
from zipfile import ZipFile

import h5py
import numpy as np

from stseg.io.extras import load_extra


def _of_text(path: Path) -> int:
    with path.open("rb") as file:
        return sum(line[:1].isdigit() and line.endswith(b"\n") for line in file)


def _of_parquet(path: Path) -> int:
    parquet = load_extra("pyarrow.parquet", "parquet")
    with path.open("rb") as file:
        return int(parquet.read_table(file).num_rows)


def _of_members(path: Path, mark: bytes) -> int:
    with ZipFile(path) as archive:
        return sum(archive.read(name).count(mark) for name in archive.namelist())


def _of_label_studio(path: Path) -> int:
    with ZipFile(path) as archive:
        tasks = [json.loads(archive.read(name))[0] for name in archive.namelist()]
    return sum(len(one["value"]["sequence"]) for task in tasks for one in task["annotations"][0]["result"])


def _of_wildtrack(path: Path) -> int:
    with ZipFile(path) as archive:
        files = [archive.read(name) for name in archive.namelist() if name.startswith("annotations_positions/")]
    return sum(len(json.loads(file)) for file in files)


def _of_jupedsim(path: Path) -> int:
    with closing(sqlite3.connect(path)) as database:
        require_sound_pages(database)
        return int(database.execute("SELECT COUNT(*) FROM trajectory_data").fetchone()[0])


def require_sound_pages(database: sqlite3.Connection) -> None:
    """Raise sqlite3.DatabaseError unless all pages of a database hold what their headers say."""
    if problems := [str(words) for (words,) in database.execute("PRAGMA quick_check") if words != "ok"]:
        raise sqlite3.DatabaseError(problems[0])


def _of_movement(path: Path) -> int:
    with h5py.File(path) as file:
        return int(np.isfinite(file["position"][:]).sum()) // 2


def _of_moving_features(path: Path) -> int:
    return sum(len(one["temporalGeometry"]["datetimes"]) for one in json.loads(path.read_bytes())["features"])


def _of_geojson(path: Path) -> int:
    with path.open("rb") as file:
        shapes = [json.loads(line)["geometry"] for line in file]
    return sum(1 if one["type"] == "Point" else len(one["coordinates"]) for one in shapes)


ROW_COUNTS: Mapping[str, Callable[[Path], int]] = {
    **dict.fromkeys(("csv", "mot", "pedpy", "napari"), _of_text),
    **dict.fromkeys(("movement", "movement-boxes"), _of_movement),
    "parquet": _of_parquet,
    "mot-boxes": partial(_of_members, mark=b"\n"),
    "coco": lambda path: len(json.loads(path.read_bytes())["annotations"]),
    "cvat": partial(_of_members, mark=b' outside="0" '),
    "label-studio": _of_label_studio,
    "wildtrack": _of_wildtrack,
    "jupedsim": _of_jupedsim,
    "mf-json": _of_moving_features,
    "geojson": _of_geojson,
}
"""By the format's name: rows of a person in a frame, and in a view where the format is one of boxes."""
