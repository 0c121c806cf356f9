"""Tables of measures as CSV or Parquet."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from stseg.arrays import Rows
from stseg.io.extras import load_extra
from stseg.io.outputs.whole_files import replacing


def write_tables(folder: Path, tables: Mapping[str, Rows], suffix: str, overwrite: bool) -> None:
    """Write each table to FOLDER/NAME.SUFFIX, `csv` or `parquet`."""
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
    return f"{value:.6g}" if isinstance(value, float) else value


def _write_parquet(path: Path, rows: Rows) -> None:
    arrow, parquet = load_extra("pyarrow", "parquet"), load_extra("pyarrow.parquet", "parquet")
    columns = {name: rows[name].tolist() for name in rows.dtype.names or ()}
    types = {name: arrow.string() if rows.dtype[name] == np.dtype("O") else None for name in columns}
    table = arrow.table({name: arrow.array(column, types[name]) for name, column in columns.items()})
    with path.open("wb") as file:  # a path that is no UTF-8 is refused by the library
        parquet.write_table(table, file)
