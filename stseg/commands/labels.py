"""`stseg labels`: for every pixel of every camera, which track it shows."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from stseg.commands.run_frames import select_frames
from stseg.commands.terminal.progress import TerminalReporter
from stseg.io.config_file import parse_config
from stseg.io.runfile.runs import read_run
from stseg.reporting.pictures.colours import track_palette
from stseg.tasks.pixel_labels import write_labels


def labels(
    run_file: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"], metavar="FOLDER")],
    frames: Annotated[str | None, Parameter(metavar="A:B")] = None,
    set_: Annotated[tuple[str, ...], Parameter(name="--set", metavar="SECTION.KEY=VALUE", negative="")] = (),
    overwrite: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Write for every pixel of every camera which track it shows.

    Example: stseg labels night.h5 -o night_labels/

    The cameras' streams are read again, where the run file says they are. FOLDER/CAMERA/000123.png is the image of
    frame 123, as large as the camera's: ids of tracks, 0 for background; indexed, in the tracks' colours, or grey of 16
    bits where an id is above 255. Cameras that deliver boxes have no pixels, and no images.

    Parameters
    ----------
    run_file
        A run file (.h5).
    output
        Folder to write to.
    frames
        Part of the run, half open.
    set_
        One constant other than those of the run, for example --set labels.samples=32; may be given several times.
    overwrite
        Write into a folder that is not empty.
    """
    run = read_run(run_file)
    config = parse_config(run.provenance.config, f"{run_file}: the configuration", set_)
    count = write_labels(
        run, config, output, select_frames(run, frames), track_palette(), TerminalReporter(), overwrite=overwrite
    )
    print(f"{output}: {count} label images")
