"""An archive of many runs as one SQLite or DuckDB database: tables recordings, tracks, events and trajectory."""

import errno
import sqlite3
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np

from stseg.arrays import Rows, by_track
from stseg.errors import printable
from stseg.io.exports.row_counts import require_sound_pages
from stseg.io.extras import load_extra
from stseg.io.outputs.whole_files import MARK
from stseg.io.runfile.reading.run_reader import Run
from stseg.io.untrusted.values import require_utf8

_TABLES = {
    "recordings": (
        "recording TEXT, file TEXT, created TEXT, frame_rate DOUBLE, frames BIGINT, seconds DOUBLE, cameras TEXT, "
        "x0 DOUBLE, y0 DOUBLE, x1 DOUBLE, y1 DOUBLE, tracks BIGINT, people_mean DOUBLE"
    ),
    "tracks": (
        "recording TEXT, id BIGINT, name TEXT, first BIGINT, last BIGINT, start DOUBLE, seconds DOUBLE, "
        "frames BIGINT, height DOUBLE, score DOUBLE, distance DOUBLE"
    ),
    "events": "recording TEXT, frame BIGINT, time DOUBLE, kind TEXT, id BIGINT, other BIGINT, reason TEXT",
    "trajectory": (
        "recording TEXT, frame BIGINT, time DOUBLE, id BIGINT, x DOUBLE, y DOUBLE, height DOUBLE, score DOUBLE"
    ),
}
"""Columns of the tables; metres, seconds, nats. `recording` is the run file's name without its suffix."""


def write_sqlite(path: Path, runs: Sequence[Run]) -> None:
    """Write an SQLite database."""
    path.unlink(missing_ok=True)
    try:
        with closing(sqlite3.connect(path)) as connection:
            connection.execute("PRAGMA journal_mode = OFF")  # nothing lies beside the part of a killed command
            with connection:
                rows = _fill(connection, runs)
        with closing(sqlite3.connect(path)) as connection:
            require_sound_pages(connection)
            _require_rows(connection, rows)
    except sqlite3.Error as error:
        raise OSError(errno.EIO, str(error)) from error


def write_duckdb(path: Path, runs: Sequence[Run]) -> None:
    """Write a DuckDB database (needs duckdb)."""
    duckdb = load_extra("duckdb", "duckdb")
    require_utf8(path, "DuckDB")
    path.unlink(missing_ok=True)
    log = path.with_name(f"{path.name}.wal")
    try:
        with duckdb.connect(str(path)) as connection:
            connection.execute("BEGIN")
            rows = _fill(connection, runs)
            connection.execute(f"COMMENT ON TABLE recordings IS '{MARK.decode()}'")
            connection.execute("COMMIT")
            connection.execute("CHECKPOINT")
        log.unlink(missing_ok=True)  # on a full disk the rows may be in it alone, and closing says nothing
        with duckdb.connect(str(path), read_only=True) as connection:
            for table in rows:  # a count alone reads no rows
                connection.execute(f"SELECT BIT_XOR(HASH({table})) FROM {table}").fetchall()
            _require_rows(connection, rows)
    except duckdb.Error as error:
        raise OSError(errno.EIO, str(error).partition("\n")[0]) from error
    finally:
        log.unlink(missing_ok=True)


ARCHIVES: Mapping[str, Callable[[Path, Sequence[Run]], None]] = {"sqlite": write_sqlite, "duckdb": write_duckdb}
"""By the name that `stseg export --to` takes."""


def _fill(connection: Any, runs: Sequence[Run]) -> dict[str, int]:
    """Make and fill the tables; the number of rows of each."""
    counts = dict.fromkeys(_TABLES, 0)
    for table, columns in _TABLES.items():
        connection.execute(f"CREATE TABLE {table} ({columns} /* {MARK.decode()} */)")
    for run in runs:
        for table, rows in _rows(run):
            places = ", ".join("?" * len(_TABLES[table].split(",")))
            if values := list(rows):
                connection.executemany(f"INSERT INTO {table} VALUES ({places})", values)
                counts[table] += len(values)
    return counts


def _require_rows(connection: Any, counts: Mapping[str, int]) -> None:
    """Raise OSError unless the tables hold so many rows."""
    for table, count in counts.items():
        ((found,),) = connection.execute(f"SELECT COUNT(*) FROM {table}").fetchall()
        if found != count:
            raise OSError(errno.EIO, f"{found} of {count} rows of the table {table} after writing")


def _rows(run: Run) -> Iterator[tuple[str, Iterable[tuple[object, ...]]]]:
    run.require_consistency()
    name, file = printable(run.path.stem), printable(str(run.path))
    rate, grid = run.frame_rate, run.recording.rig.grid
    seconds, people = len(run.frames) / rate, len(run.trajectory) / max(len(run.frames), 1)
    about = (name, file, run.provenance.created, rate, len(run.frames), seconds, ",".join(run.cameras))
    yield "recordings", [(*about, grid.x[0], grid.y[0], grid.x[1], grid.y[1], len(run.tracks), people)]
    lengths = _path_lengths(run.trajectory)
    yield "tracks", (_track(run, name, row, lengths.get(int(row["id"]), 0.0)) for row in run.tracks)
    yield "events", _event_rows(run, name)
    yield "trajectory", _place_rows(run, name)


def _event_rows(run: Run, recording: str) -> Iterator[tuple[object, ...]]:
    for event in run.events:
        kind, reason = (event[name].decode(errors="replace") for name in ("kind", "reason"))
        frame = int(event["frame"])
        yield recording, frame, frame / run.frame_rate, kind, int(event["id"]), int(event["other"]), reason


def _place_rows(run: Run, recording: str) -> Iterator[tuple[object, ...]]:
    for row in run.trajectory:
        frame, height, score = int(row["frame"]), _finite(row["height"]), _finite(row["score"])
        yield recording, frame, frame / run.frame_rate, int(row["id"]), float(row["x"]), float(row["y"]), height, score


def _path_lengths(trajectory: Rows) -> dict[int, float]:
    """Length of each track's path, metres."""
    tracks = by_track(trajectory)
    return {int(rows["id"][0]): float(np.hypot(np.diff(rows["x"]), np.diff(rows["y"])).sum()) for rows in tracks}


def _track(run: Run, recording: str, row: np.void, distance: float) -> tuple[object, ...]:
    identity, rate = int(row["id"]), run.frame_rate
    first, last = int(row["first"]), int(row["last"])
    spans = (first, last, first / rate, (last - first + 1) / rate, int(row["frames"]))
    return recording, identity, run.names.get(identity), *spans, _finite(row["height"]), _finite(row["score"]), distance


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
