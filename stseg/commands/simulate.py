"""`stseg simulate`: render a scene with ground truth."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from stseg.commands.calibrate.scene import size_of
from stseg.commands.terminal.counts import counted
from stseg.commands.terminal.standard_error import TerminalReporter
from stseg.tasks import simulation


def simulate(
    folder: Path,
    /,
    *,
    scene: str = "easy",
    people: int | None = None,
    cameras: int | None = None,
    seconds: float | None = None,
    frame_rate: float | None = None,
    size: Annotated[str | None, Parameter(metavar="W,H")] = None,
    noise: float | None = None,
    shadows: float | None = None,
    light_drift: float | None = None,
    alike: int | None = None,
    seed: int | None = None,
    spoil: Annotated[tuple[str, ...], Parameter(metavar="KIND[:STRENGTH]", negative="")] = (),
    instances: Annotated[bool, Parameter(negative="")] = False,
    overwrite: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Render a simulated scene: videos of every camera, exact masks, a detector's boxes, rig files and truth.

    Example: stseg simulate crowd/ --scene dense --cameras 4 --seconds 10

    Then: stseg run crowd/rig.toml -o crowd.h5, and stseg evaluate crowd.h5 crowd/truth.csv

    Parameters
    ----------
    folder
        Where to write; it must be empty or not there yet.
    scene
        easy (5 people, 4 cameras), dense (14 people on 6 m x 6 m, 8 cameras), dense4 (the same crowd, 4 of those
        cameras), similar (4 people, 3 of them dressed alike, 3 cameras), plaza (7 upright cylinders on 20 m x 20 m, 7
        cameras), large_plaza (10 on 40 m x 40 m, 8 cameras), school (adults and children), animals (0.6 m high and 1.1
        m long), demo (small images, 8 s), tiny (a second of very small images), long (boxes alone of 10 people in a
        closed room for half an hour), return (small images of 6 people who come and go for 10 minutes), or small images
        of scripted routes: crossing, meeting, meeting_heights (the same, 8 cm apart in height), border (encounters,
        entries and exits where windows meet). The other options change it.
    people
        Number of people in the area; of all who come and go in the scene return.
    cameras
        Number of cameras around the area.
    seconds
        Length of the recording.
    frame_rate
        Frames per second.
    size
        Width and height of the images, pixels.
    noise
        Standard deviation of the sensors' noise, grey levels.
    shadows
        Darkening of the ground by the people's shadows, 0..1.
    light_drift
        Relative amplitude of slow changes of the light, 0..1.
    alike
        Number of people in clothes of similar colours.
    seed
        Seed of people, paths and cameras.
    spoil
        Errors of the masks and boxes, which are exact and good without it: dilation, erosion (share of a body's
        width), holes (share of the silhouettes), legs (share of the height that is missing), shadows (length, share
        of the height), flicker (share of the time that a person is missing), staying (blobs that stay), rain (small
        blobs a frame), jpeg (1 - quality / 100); jitter of boxes (share of their size), missed, doubled (share of the
        boxes). Without a strength a middle one; the option may be repeated.
    instances
        Write images of person ids, too.
    overwrite
        Write into a folder that is not empty.
    """
    film = simulation.simulate(
        folder,
        scene,
        spoil=spoil,
        instances=instances,
        overwrite=overwrite,
        progress=TerminalReporter(),
        people=people,
        cameras=cameras,
        seconds=seconds,
        frame_rate=frame_rate,
        size=None if size is None else size_of(size),
        noise=noise,
        shadows=shadows,
        light_drift=light_drift,
        alike=alike,
        seed=seed,
    )
    size_of_film = f"{counted(film.frames, 'frame')} of {counted(film.cameras, 'camera')}"
    print(f"{film.rig_path}: {size_of_film}; truth in {film.truth_path.name}")
