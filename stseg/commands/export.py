"""`stseg export`: the tracks of a run file in another format."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from stseg.commands.options import Overwrite
from stseg.commands.terminal.counts import counted
from stseg.commands.terminal.standard_error import warn
from stseg.errors import ConfigError, one_of
from stseg.io.answers import read_names
from stseg.io.exports.archive import ARCHIVES
from stseg.io.exports.formats import FORMATS, help_text, write_tracks
from stseg.io.outputs.whole_files import Inputs, replacing, require_output
from stseg.io.runfile.runs import Run, read_run
from stseg.io.untrusted.values import abbreviated

_NAMED = "csv", "parquet", "geojson", "mf-json"
"""Formats of one run that hold names of tracks."""


def export(
    run: Path,
    /,
    *more: Path,
    to: Annotated[str, Parameter(metavar="FORMAT")],
    output: Annotated[Path, Parameter(name=["--output", "-o"], metavar="FILE")],
    names: Annotated[Path | None, Parameter(metavar="NAMES.csv")] = None,
    overwrite: Overwrite = False,
) -> None:
    """Write the tracks of a run file in another format.

    Example: stseg export night.h5 --to csv -o night.csv

    Example: stseg export week/*.h5 --to duckdb -o week.duckdb

    {formats}

    **sqlite**, **duckdb**: a database of one run or many: recordings, tracks, events and trajectory.

    Parameters
    ----------
    run
        The run file.
    more
        Further run files, of a database.
    to
        One of those above.
    output
        The file to write.
    names
        CSV with the columns id,name, for formats that hold names: csv, parquet, geojson, mf-json and the databases.
    """
    if to not in (*FORMATS, *ARCHIVES):
        raise ConfigError("command line", "--to", repr(to), one_of(to, (*FORMATS, *ARCHIVES)))
    if more and to not in ARCHIVES:
        raise ConfigError("command line", "RUN", f"{1 + len(more)} run files", f"one, or --to {' or '.join(ARCHIVES)}")
    if names is not None and to not in (*_NAMED, *ARCHIVES):
        raise ConfigError("command line", "--names", f"--to {to}", f"one of {', '.join((*_NAMED, *ARCHIVES))}")
    contents, others = read_run(run), [read_run(one) for one in more]
    inputs = Inputs([names], *(one.files for one in (contents, *others)))
    require_output(output, overwrite, inputs, FORMATS[to].table if to in FORMATS else "")
    if names is not None:
        given = read_names(names)
        if strange := sorted(given.keys() - set(contents.tracks["id"].tolist())):
            warn([f"{names}: names of tracks that the run has not: {abbreviated(strange)}"])
        contents = contents.with_names(given)
    if to in ARCHIVES:
        _archive(to, output, [contents, *others], overwrite)
        return
    with replacing(output, overwrite) as part:
        write_tracks(to, part, contents)
    rows, tracks = counted(len(contents.trajectory), "row"), counted(len(contents.tracks), "track")
    print(f"wrote {rows} of {tracks} to {output}")


def _archive(to: str, output: Path, runs: Sequence[Run], overwrite: bool) -> None:
    stems = [run.path.stem for run in runs]
    if len(set(stems)) < len(stems):
        raise ConfigError("command line", "RUN", f"{max(stems, key=stems.count)} twice", "files of different names")
    with replacing(output, overwrite) as part:
        ARCHIVES[to](part, runs)
    print(f"wrote {len(runs)} recording{'s' * (len(runs) != 1)} to {output}")


export.__doc__ = (export.__doc__ or "").replace("{formats}", help_text())
