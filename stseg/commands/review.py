"""`stseg review`: a page that asks about the decisions of which a run is least sure."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from stseg.commands.options import Overwrite
from stseg.commands.terminal.counts import counted
from stseg.errors import ConfigError
from stseg.tasks.review import write_review


def review(
    run_file: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"], metavar="REVIEW.html")],
    most: int = 50,
    camera_images: Annotated[bool, Parameter(negative="")] = False,
    overwrite: Overwrite = False,
) -> None:
    """Make a page that asks about the decisions of which a run is least sure, in the order of doubt.

    Example: stseg review night.h5 -o review.html --camera-images

    Each question (were two people swapped? is it the same person after a gap? is a track no person?) comes with
    pictures before, during and after, in the two views that tell most; one key answers. Save answers.csv and give it
    to stseg correct.

    Parameters
    ----------
    run_file
        A run file (.h5).
    output
        The page.
    most
        Number of questions at most; decisions that are more than 99 % certain are not asked about.
    camera_images
        Show the cameras' frames under the tracks. The page then holds images of people.
    """
    if most < 1:
        raise ConfigError("--most", "", most, "1 or more questions")
    count = write_review(run_file, output, most=most, camera_images=camera_images, overwrite=overwrite)
    print(f"wrote {output}: {counted(count, 'question')}")
