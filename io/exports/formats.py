"""The export formats: a new one is a writer, an entry here, and a line in docs/outputs.md."""

import errno
import sqlite3
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal
from zipfile import BadZipFile

from stseg.io.exports import benchmarks, geographic, labelling, movement, tables
from stseg.io.exports.row_counts import ROW_COUNTS
from stseg.io.runfile.reading.run_reader import Run


@dataclass(frozen=True, slots=True)
class ExportFormat:
    """One format of tracks."""

    write: Callable[[Path, Run], None]
    """Writes a run's tracks to a path."""
    about: str
    """Description for `stseg export --help`."""
    rows: Literal["trajectory", "boxes"] = "trajectory"
    """The table whose rows it holds."""
    table: str = ""
    """Regular expression of its beginnings, where it has no room for the mark of `whole_files`."""


FORMATS: Mapping[str, ExportFormat] = {
    "csv": ExportFormat(
        tables.write_csv,
        "frame, id, x, y, height, score, covariance and views, with a header; metres",
        table="frame,id,x,y,height,score,xx,xy,yy,views",
    ),
    "parquet": ExportFormat(tables.write_parquet, "every column of the trajectory, and the time"),
    "mot": ExportFormat(
        benchmarks.write_mot, "3-D MOTChallenge lines; frames count from 1 there", table=r"\d+,\d+,-1,-1,-1,-1,1,"
    ),
    "mot-boxes": ExportFormat(
        benchmarks.write_mot_boxes, "a zip of 2-D MOTChallenge lines, one file a camera", "boxes"
    ),
    "coco": ExportFormat(labelling.write_coco, "a COCO data set of the boxes in all views", "boxes"),
    "cvat": ExportFormat(labelling.write_cvat, "a zip of CVAT's XML for videos, one file a camera", "boxes"),
    "label-studio": ExportFormat(
        labelling.write_label_studio, "a zip of Label Studio's tasks, one file a camera", "boxes"
    ),
    "wildtrack": ExportFormat(
        benchmarks.write_wildtrack, "a zip of WILDTRACK's annotations_positions, and the grid that they use"
    ),
    "pedpy": ExportFormat(
        movement.write_pedpy,
        "the text of PedPy and JuPedSim (PedPy reads the run file itself, too)",
        table="# framerate: .*\n# id frame x",
    ),
    "jupedsim": ExportFormat(movement.write_jupedsim, "JuPedSim's SQLite trajectory"),
    "movement": ExportFormat(movement.write_movement, "netCDF of the package movement, places on the ground"),
    "movement-boxes": ExportFormat(movement.write_movement_boxes, "the same of the boxes in all views", "boxes"),
    "mf-json": ExportFormat(geographic.write_moving_features, "OGC Moving Features JSON"),
    "geojson": ExportFormat(geographic.write_geojson_lines, "GeoJSON, one track a line"),
    "napari": ExportFormat(
        tables.write_napari_tracks, "the CSV of napari-tracks", table="particle,frame,z,y,x,score,height\n"
    ),
}
"""By the name that `stseg export --to` takes."""


def write_tracks(to: str, path: Path, run: Run) -> None:
    """Write a run's tracks in one of `FORMATS`, and count its rows.

    FormatError where the run's tables do not fit each other; OSError where rows are missing in the file.
    """
    run.require_consistency()
    try:
        FORMATS[to].write(path, run)
        found, rows = ROW_COUNTS[to](path), len(getattr(run, FORMATS[to].rows))
    except (sqlite3.Error, zlib.error, BadZipFile, ValueError, KeyError) as error:
        raise OSError(errno.EIO, str(error)) from error
    if found != rows:
        raise OSError(errno.EIO, f"{found} of {rows} rows after writing")


def help_text() -> str:
    """The formats as paragraphs of a command's help."""
    return "\n\n".join(f"    **{name}**: {form.about}." for name, form in FORMATS.items()).strip()
