"""`stseg export`: the tracks of a run file in another format."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from stseg.errors import ConfigError
from stseg.io.outputs import replacing, require_new
from stseg.io.runs import Run, read_run
from stseg.io.track_exports import write_mot, write_pedpy
from stseg.io.tracks import write_tracks_csv

_WRITERS: dict[str, Callable[[Path, Run], None]] = {
    "csv": lambda path, run: write_tracks_csv(path, run.trajectory),
    "mot": lambda path, run: write_mot(path, run.trajectory),
    "pedpy": lambda path, run: write_pedpy(path, run.trajectory, run.frame_rate),
}


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

    **pedpy**: the text of PedPy and JuPedSim; id, frame, x, y, z in metres. (PedPy reads the run file itself, too.)

    **mot**: 3-D MOTChallenge lines; frames count from 1 there.

    Parameters
    ----------
    run
        The run file.
    to
        csv, pedpy or mot.
    output
        The file to write.
    overwrite
        Replace the file if it exists.
    """
    if to not in _WRITERS:
        raise ConfigError("command line", "--to", repr(to), f"one of {', '.join(_WRITERS)}")
    require_new(output, overwrite)
    if output.exists() and run.exists() and output.samefile(run):
        raise ConfigError("command line", "--output", "the run file itself", "another file")
    contents = read_run(run)
    with replacing(output, overwrite) as part:
        _WRITERS[to](part, contents)
    print(f"wrote {len(contents.trajectory)} rows of {len(contents.tracks)} tracks to {output}")
