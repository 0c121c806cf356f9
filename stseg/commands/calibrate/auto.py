"""`stseg calibrate auto`: a rig from the videos themselves."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from stseg.commands.options import Frames, Overwrite
from stseg.commands.terminal.standard_error import TerminalReporter
from stseg.engine.offline.frame_range import FrameRange
from stseg.errors import ConfigError
from stseg.geometry import Grid
from stseg.io.untrusted.values import abbreviated, parse_numbers
from stseg.tasks.calibration import automatic
from stseg.tasks.calibration.automatic import AutomaticCalibration, Distance, camera_names


def calibrate_auto(
    *videos: Annotated[Path, Parameter(metavar="VIDEO...")],
    output: Annotated[Path, Parameter(name=["--output", "-o"], metavar="RIG.toml")],
    frame_rate: float | None = None,
    person_height: float = 1.7,
    distance: Annotated[tuple[str, ...], Parameter(metavar="CAMERA,U,V,U,V,METRES", negative="")] = (),
    most_delay: float = 2.0,
    frames: Frames = None,
    background: Annotated[str | None, Parameter(metavar="PATTERN")] = None,
    source_kind: Literal["video", "masks"] = "video",
    cell: float = Grid.cell,
    overwrite: Overwrite = False,
) -> None:
    """Make a rig file from the videos alone: from people who walk where several cameras see them.

    Each camera learns its background and finds isolated people. Their feet and heads give its lens, tilt and height;
    their paths give the cameras' positions and delays; a bundle adjustment refines everything, with floor features that
    views share, where there are any. One or two people who walk all over the ground for a minute are best.

    ```
    stseg calibrate auto cam*.avi -o room.toml --frame-rate 25 --distance cam1,120,340,410,335,2.5
    ```

    Parameters
    ----------
    videos
        One video a camera; file names become camera names.
    output
        The rig file to write.
    frame_rate
        Frames per second of all videos; by default what their heads agree on.
    person_height
        Mean body height, metres. It sets the scale where no distance is given.
    distance
        Two ground pixels of one camera and their distance in metres; it sets the scale. May be repeated.
    most_delay
        Greatest delay of one video against another, seconds; 0 where all are synchronous.
    frames
        Part of the videos, half open; without it the first 3000 frames.
    background
        Video of every camera's empty scene, `{name}` standing for the camera's name.
    source_kind
        Colour videos, or videos of masks.
    cell
        Side of a ground cell of the rig, metres.
    """
    distances = [_distance(text, camera_names(videos)) for text in distance]
    found = automatic.calibrate_auto(
        videos,
        output,
        frame_rate=frame_rate,
        person_height=person_height,
        distances=distances,
        most_delay=most_delay,
        frames=FrameRange.parsed(frames),
        background=background,
        source_kind=source_kind,
        cell=cell,
        overwrite=overwrite,
        progress=TerminalReporter(),
    )
    _print(found, person_height, distances)
    offsets = {source.offset for source in found.recording.sources}
    if most_delay and len(offsets) > 1 and max(offsets) - min(offsets) == 1:
        print("offsets: all within one frame; if the cameras are synchronous, say so (--most-delay 0)")
    print(
        f"{output}: {len(found.reports)} cameras, from {found.people} people and frames"
        f"{f' and {found.floor_marks}' if found.floor_marks else '; no'} marks on the floor that views share"
    )


def _print(found: AutomaticCalibration, person_height: float, distances: Sequence[Distance]) -> None:
    cameras = zip(found.recording.rig.cameras, found.recording.sources, found.reports, strict=True)
    for camera, source, report in cameras:
        x, y, z = camera.centre
        print(
            f"{camera.name}: at ({x:.2f}, {y:.2f}, {z:.2f}) m ± {report.centre_spread:.2f}, "
            f"focal length {report.focal:.0f} ± {report.focal_spread:.0f} px, "
            f"offset {source.offset} and {report.clock:+.3f} ± {report.clock_spread:.3f} s; "
            f"{report.observations} sightings: feet {report.foot_pixels:.1f} px ({100 * report.ground_metres:.0f} cm), "
            f"heads {report.head_pixels:.1f} px ({100 * report.head_metres:.0f} cm) off"
        )
    spread = f"all lengths are uncertain by {100 * found.scale_spread:.1f} % (one standard deviation)"
    for (view, *_, metres), length in zip(distances, found.distances, strict=True):
        off = round(100 * (length / metres - 1), 1) + 0.0  # no -0.0
        print(f"distance in {view}: {length:.3f} m instead of {metres:g} ({off:+.1f} %)")
    if distances:
        print(f"scale: by what is given; people are {found.height:.2f} m tall on the average; {spread}")
    else:
        print(f"scale: people are taken to be {person_height:g} m tall on the average (--person-height); {spread}")
        print("scale: one or more distances on the floor make it certain (--distance)")


def _distance(text: str, names: Sequence[str]) -> Distance:
    camera, _, rest = text.partition(",")
    found = parse_numbers(rest.split(","))
    if found is None or len(found) != 5:
        expected = f"camera,u,v,u,v,metres with a camera of {', '.join(names)}"
        raise ConfigError("--distance", "", abbreviated(text), expected)
    u0, v0, u1, v1, metres = found
    return camera, u0, v0, u1, v1, metres
