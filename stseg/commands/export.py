"""`stseg export`: the tracks of a run file in another format."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from stseg.errors import ConfigError
from stseg.io.exports.formats import FORMATS
from stseg.io.outputs.whole_files import replacing, require_new
from stseg.io.runfile.runs import read_run


def export(
    run: Path,
    /,
    *,
    to: Annotated[str, Parameter(metavar="FORMAT")],
    output: Annotated[Path, Parameter(name=["--output", "-o"], metavar="FILE")],
    overwrite: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Write the tracks of a run file in another format.

    Example: stseg export night.h5 --to csv -o night.csv

    **csv**: frame, id, x, y, height, score, covariance and views, with a header; metres.

    **parquet**: every column of the trajectory, and the time.

    **mot**: 3-D MOTChallenge lines; frames count from 1 there. **mot-boxes**: a zip of 2-D lines, one file a camera.

    **wildtrack**: a zip of WILDTRACK's annotations_positions, and the grid that they use.

    **pedpy**: the text of PedPy and JuPedSim. (PedPy reads the run file itself, too.) **jupedsim**: JuPedSim's SQLite
    trajectory.

    **movement**: netCDF of the package movement, places on the ground. **movement-boxes**: the boxes of all views.

    **mf-json**: OGC Moving Features JSON. **geojson**: GeoJSON, one track a line. **napari**: the CSV of napari-tracks.

    Parameters
    ----------
    run
        The run file.
    to
        One of those above.
    output
        The file to write.
    overwrite
        Replace the file if it exists.
    """
    if to not in FORMATS:
        raise ConfigError("command line", "--to", repr(to), f"one of {', '.join(FORMATS)}")
    require_new(output, overwrite)
    if output.exists() and run.exists() and output.samefile(run):
        raise ConfigError("command line", "--output", "the run file itself", "another file")
    contents = read_run(run)
    with replacing(output, overwrite) as part:
        FORMATS[to](part, contents)
    print(f"wrote {len(contents.trajectory)} rows of {len(contents.tracks)} tracks to {output}")
