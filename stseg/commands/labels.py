"""`stseg labels`: for every pixel of every camera, which track it shows."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from stseg.commands.options import Frames, Settings
from stseg.commands.terminal.standard_error import TerminalReporter
from stseg.engine.offline.frame_range import FrameRange
from stseg.tasks.pixel_labels import label_images


def labels(
    run_file: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"], metavar="FOLDER")],
    frames: Frames = None,
    set_: Settings = (),
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
    chosen = FrameRange.parsed(frames)
    count = label_images(
        run_file, output, frames=chosen, changes=set_, overwrite=overwrite, progress=TerminalReporter()
    )
    print(f"{output}: {count} label images")
