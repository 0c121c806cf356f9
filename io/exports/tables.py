"""Plain tables: tracks as CSV, Parquet, and the CSV of napari-tracks and trackpy; measures as CSV or Parquet."""

import csv
import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from stseg.arrays import Rows
from stseg.io.extras import load_extra
from stseg.io.outputs.whole_files import MARK, Inputs, replacing, require_output
from stseg.io.runfile.reading.run_reader import Run
from stseg.io.track_csv import write_tracks_csv

_UNITS = {"score": "nat", "time": "s"} | dict.fromkeys(("xx", "xy", "yy", "extent"), "m2")
_UNITS |= dict.fromkeys(("x", "y", "z", "height", "width", "raw_x", "raw_y"), "m")


def write_csv(path: Path, run: Run) -> None:
    """Write frame, id, x, y, height, score, xx, xy, yy, views; positions to 0.1 mm; name where tracks have one."""
    write_tracks_csv(path, run.trajectory, overwrite=True)
    if run.names:
        header, *lines = path.read_text(encoding="utf-8").splitlines()
        names = [run.names.get(int(identity), "") for identity in run.trajectory["id"]]
        with path.open("w", newline="", encoding="utf-8") as file:
            csv.writer(file, lineterminator="\n").writerows(
                [*line.split(","), name] for line, name in zip((header, *lines), ("name", *names), strict=True)
            )


def write_parquet(path: Path, run: Run) -> None:
    """Write all columns of the trajectory, nan as null, and `time` in seconds; each column's metadata has its unit.

    The file's metadata under `stseg` say, as JSON, the scene, the frames per second and the cameras.
    """
    arrow, parquet = load_extra("pyarrow", "parquet"), load_extra("pyarrow.parquet", "parquet")
    columns = {name: run.trajectory[name] for name in run.trajectory.dtype.names or ()}
    columns["time"] = run.trajectory["frame"] / run.frame_rate
    arrays = [arrow.array(np.ascontiguousarray(column), from_pandas=True) for column in columns.values()]
    units = [{"units": _UNITS.get(name, "")} for name in columns]
    fields = [
        arrow.field(name, one.type, metadata=unit) for name, one, unit in zip(columns, arrays, units, strict=True)
    ]
    if run.names:
        fields.append(arrow.field("name", arrow.string()))
        arrays.append(arrow.array([run.names.get(int(one)) for one in run.trajectory["id"]], arrow.string()))
    about = {"scene": run.scene, "frame_rate": run.frame_rate, "cameras": list(run.cameras)}
    schema = arrow.schema(fields, {"stseg": json.dumps(about), "software": MARK.decode()})
    with path.open("wb") as file:  # a path that is no UTF-8 is refused by the library
        parquet.write_table(arrow.table(arrays, schema=schema), file)


def write_napari_tracks(path: Path, run: Run) -> None:
    """Write particle, frame, z, y, x, score, height in metres, by particle, then frame: a tracks layer of napari."""
    table = run.trajectory[np.lexsort((run.trajectory["frame"], run.trajectory["id"]))]
    with path.open("w", newline="\n", encoding="utf-8") as file:
        file.write("particle,frame,z,y,x,score,height\n")
        np.savetxt(file, table[["id", "frame", "z", "y", "x", "score", "height"]], fmt="%d,%d,%.4f,%.4f,%.4f,%.3f,%.3f")


def write_tables(folder: Path, tables: Mapping[str, Rows], suffix: str, overwrite: bool, inputs: Inputs) -> None:
    """Write each table to FOLDER/NAME.SUFFIX, `csv` or `parquet`."""
    for name, rows in tables.items():
        require_output(folder / f"{name}.{suffix}", overwrite, inputs, ",".join(rows.dtype.names or ()))
    for name, rows in tables.items():
        with replacing(folder / f"{name}.{suffix}", overwrite) as part:
            (_write_parquet if suffix == "parquet" else _write_csv)(part, rows)


def _write_csv(path: Path, rows: Rows) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(rows.dtype.names or ())
        writer.writerows([_text(value) for value in row] for row in rows.tolist())


def _text(value: object) -> object:
    if isinstance(value, bool):
        return int(value)
    return f"{value:.6g}".replace("nan", "") if isinstance(value, float) else value


def _write_parquet(path: Path, rows: Rows) -> None:
    arrow, parquet = load_extra("pyarrow", "parquet"), load_extra("pyarrow.parquet", "parquet")
    columns = {name: rows[name].tolist() for name in rows.dtype.names or ()}
    types = {name: arrow.string() if rows.dtype[name] == np.dtype("O") else None for name in columns}
    table = arrow.table({name: arrow.array(column, types[name], from_pandas=True) for name, column in columns.items()})
    table = table.replace_schema_metadata({"stseg": MARK.decode()})
    with path.open("wb") as file:  # a path that is no UTF-8 is refused by the library
        parquet.write_table(table, file)
