"""`stseg export`: the tracks of a run file in another format."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from stseg.errors import ConfigError
from stseg.io.answers import read_names
from stseg.io.exports.formats import FORMATS, help_text, write_tracks
from stseg.io.outputs.whole_files import replacing, require_new
from stseg.io.runfile.runs import read_run


def export(
    run: Path,
    /,
    *,
    to: Annotated[str, Parameter(metavar="FORMAT")],
    output: Annotated[Path, Parameter(name=["--output", "-o"], metavar="FILE")],
    names: Annotated[Path | None, Parameter(metavar="NAMES.csv")] = None,
    overwrite: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Write the tracks of a run file in another format.

    Example: stseg export night.h5 --to csv -o night.csv

    {formats}

    Parameters
    ----------
    run
        The run file.
    to
        One of those above.
    output
        The file to write.
    names
        CSV with the columns id,name: csv, parquet, geojson and mf-json hold the names of tracks too.
    overwrite
        Replace the file if it exists.
    """
    if to not in FORMATS:
        raise ConfigError("command line", "--to", repr(to), f"one of {', '.join(FORMATS)}")
    require_new(output, overwrite)
    if output.exists() and run.exists() and output.samefile(run):
        raise ConfigError("command line", "--output", "the run file itself", "another file")
    contents = read_run(run)
    if names is not None:
        contents = contents.with_names(read_names(names))
    with replacing(output, overwrite) as part:
        write_tracks(to, part, contents)
    print(f"wrote {len(contents.trajectory)} rows of {len(contents.tracks)} tracks to {output}")


export.__doc__ = (export.__doc__ or "").replace("{formats}", help_text())
