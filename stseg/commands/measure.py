"""`stseg measure`: numbers of a run for zones, lines and the ground."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from stseg.commands.options import Overwrite
from stseg.commands.terminal.standard_output import output_console, table_of
from stseg.measures.measure import Measures
from stseg.tasks import measures


def measure(
    run_file: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"], metavar="FOLDER")],
    zones: Annotated[Path | None, Parameter(metavar="ZONES.geojson")] = None,
    lines: Annotated[Path | None, Parameter(metavar="LINES.geojson")] = None,
    format_: Annotated[Literal["csv", "parquet"], Parameter(name="--format")] = "csv",
    overwrite: Overwrite = False,
) -> None:
    """Measure a run: people in zones, crossings of lines, speeds, distances, density and flow.

    Example: stseg measure night.h5 --zones zones.geojson --lines lines.geojson -o measures/

    **zones**: mean and most people, entries, exits, dwell times, density of each zone; **people**: each zone in each
    frame, with mean and standard deviation of its count by scores and places; **visits**: each stay; **lines** and
    **crossings**: each direction (left and right as seen along the line); **tracks**: distance and speeds;
    **motion**: speed, heading and acceleration with their uncertainty; **spacing**: distances between people;
    **field**: density, speed and flow on a grid, drawn in flow.png.

    The same from Python: stseg.measure(stseg.read_run("night.h5"), "zones.geojson", "lines.geojson").

    Parameters
    ----------
    run_file
        A run file (.h5).
    output
        Folder for the tables and flow.png.
    zones
        GeoJSON with polygons in metres on the ground; properties.name names each. Without it, the whole ground.
    lines
        GeoJSON with lines (LineString), likewise.
    format_
        csv, or parquet (needs pyarrow).
    """
    found = measures.measure(run_file, zones, lines, output=output, format_=format_, overwrite=overwrite)
    _print(found)
    print(f"wrote {len(found.tables())} tables and flow.png to {output}")


def _print(found: Measures) -> None:
    console = output_console()
    rows = []
    for row in found.zones:
        people = f"{row['mean_people']:.2f} ± {row['deviation']:.2f}"
        numbers = (f"{row['median_dwell']:.1f}", f"{row['mean_density']:.3f}")
        rows.append((row["zone"], people, str(row["most_people"]), str(row["entries"]), str(row["exits"]), *numbers))
    console.print(table_of(("zone", "people", "most", "entries", "exits", "dwell s", "per m2"), rows))
    if len(found.lines):
        crossings = [
            (row["line"], str(row["left"]), str(row["right"]), f"{row['per_minute']:.1f}") for row in found.lines
        ]
        console.print(table_of(("line", "to left", "to right", "a minute"), crossings))
