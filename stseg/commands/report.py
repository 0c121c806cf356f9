"""`stseg report`: a run as one HTML page, as pictures and as a film."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from stseg.commands.options import Frames, Overwrite
from stseg.commands.terminal.counts import counted
from stseg.commands.terminal.standard_error import TerminalReporter
from stseg.engine.offline.frame_range import FrameRange, frames_of_run
from stseg.io.runfile.runs import read_run
from stseg.tasks import report as reports


def report(
    run_file: Path,
    /,
    *,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"], metavar="REPORT.html")] = None,
    truth: Path | None = None,
    frame: Annotated[tuple[int, ...], Parameter(negative="")] = (),
    pictures: Annotated[Path | None, Parameter(metavar="FOLDER")] = None,
    video: Annotated[Path | None, Parameter(metavar="FILM.webm")] = None,
    frames: Frames = None,
    camera_images: Annotated[bool, Parameter(negative="")] = False,
    names: Annotated[Path | None, Parameter(metavar="NAMES.csv")] = None,
    overwrite: Overwrite = False,
) -> None:
    """Make an HTML page of a run that needs no other file and loads nothing, or a film of it.

    Example: stseg report night.h5 -o night.html --truth truth.csv --frame 60 --pictures night/

    Example: stseg report night.h5 --video night.webm --camera-images --frames 0:500

    The page shows the number of people, where they dwell, rejected ghosts with reasons, and where the rig is blind; a
    slider moves the plan, slices of the occupancy and the tracks in space and time. The film shows every view with its
    people as pillars, and the plan beside. No camera image is read or shown without --camera-images: the views then
    show the ruled ground.

    Parameters
    ----------
    run_file
        A run file (.h5).
    output
        The page to write.
    truth
        CSV with the columns frame,id,x,y (metres), drawn beside the tracks.
    frame
        A frame whose planes and camera views the page shows; may be given several times. Without it, the camera views
        of three frames of the run.
    pictures
        Folder to write the pictures to as well: plan.png, spacetime.png, slices.png, marginal.png and an
        overlay_CAMERA.png for each camera, and the maps density.png, dwell.png, flow.png, ghosts.png and blind.png.
        With several --frame, the frame's number is added to the name.
    video
        A film to write, WebM or, in four times the time, MP4. It shows the cameras' frames with --camera-images, else
        pillars on the ruled ground.
    frames
        Part of the run that the film shows, half open.
    camera_images
        Show the cameras' frames under the tracks. Page, pictures and film then hold images of people.
    names
        CSV with the columns id,name: names of tracks in the page and its pictures.
    """
    run, chosen = read_run(run_file), FrameRange.parsed(frames)
    written = reports.report(
        run, output, truth=truth, frame=frame, pictures=pictures, video=video, frames=chosen,
        camera_images=camera_images, names=names, overwrite=overwrite, progress=TerminalReporter(),
    )  # fmt: skip
    for path in written:
        film = f": {counted(len(frames_of_run(run, chosen)), 'frame')}" if path == video else ""
        print(f"wrote {path}{film}")
