"""`stseg calibrate import`: a rig from another program's calibration."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal, get_args

from cyclopts import Parameter

from stseg.commands.calibrate.scene import SceneOptions, StreamOptions, size_of, words
from stseg.commands.options import Overwrite
from stseg.errors import CalibrationError, ConfigError, one_of
from stseg.geometry import Camera, Rig
from stseg.geometry.rig import is_mirrored
from stseg.io.calibrations.foreign_camera import ForeignCamera
from stseg.io.calibrations.formats import FORMATS, ImportOptions, help_text, read_cameras
from stseg.io.calibrations.world_frame import UNITS, Up, World, guess_unit, guess_up, require_median_height
from stseg.io.outputs.whole_files import Inputs, require_output
from stseg.io.recording.recording import Recording
from stseg.io.recording.rigs import write_rig
from stseg.tasks.calibration.automatic import camera_names


def import_calibration(
    format: Annotated[str, Parameter(metavar="FORMAT")],
    /,
    *files: Annotated[str, Parameter(metavar="FILE...")],
    output: Annotated[Path, Parameter(name=["--output", "-o"], metavar="RIG.toml")],
    scene: SceneOptions,
    streams: StreamOptions | None = None,
    size: Annotated[str | None, Parameter(metavar="W,H")] = None,
    unit: Annotated[str | None, Parameter(metavar="mm|cm|m|METRES")] = None,
    up: Annotated[Up | Literal["x", "y", "z"] | None, Parameter(allow_leading_hyphen=True)] = None,
    mirrored: Annotated[bool, Parameter(negative="")] = False,
    head: float = 1.75,
    names: Annotated[str | None, Parameter(metavar="A,B,...")] = None,
    overwrite: Overwrite = False,
) -> None:
    """Make a rig file from the calibrations of other programs.

    {formats}

    Four cameras with silhouettes, calibrated in millimetres with Z pointing down:

    ```
    stseg calibrate import opencv cam*/config.xml -o room.toml \\
        --size 644,486 --unit mm --up=-z --area=-2.5,-4.5,2.5,1.5 --frame-rate 5 \\
        --source-pattern '{name}/silhouettes.avi' --source-kind masks
    ```

    Parameters
    ----------
    format
        Format of the calibrations.
    files
        The calibrations.
    output
        The rig file to write.
    size
        Width and height of the images, pixels; not needed where the calibrations hold it.
    unit
        Unit of length of the calibrations: mm, cm, m, or metres per unit. Without it, the one that gives plausible
        camera heights; the choice is printed.
    up
        Which of their axes points away from the ground. With -z, X = x, Y = -y, Z = -z; with -y (a camera's own
        axes), X = x, Y = -z, Z = y. Without it, the one that is upwards in the images.
    mirrored
        The calibrations are left-handed: our y is theirs, the other way round. --area is in our y.
    head
        pom: height of the head plane, metres.
    names
        Names of the cameras; without them, those in the calibrations, of the files, or of their folders where all
        files are called the same.
    """
    require_output(output, overwrite, Inputs(Path(part) for file in files for part in file.split("+")))
    shared = None if size is None else size_of(size)
    foreign = _named(_read(format, files, ImportOptions(shared, unit, head)), files, names)
    world = _world(foreign, unit, up, mirrored)
    cameras = tuple(world.camera(one, one.name, _size(one, shared)) for one in foreign)
    rig = Rig(scene.scene or output.stem, scene.frame_rate, scene.grid, cameras)
    try:
        sources = (streams or StreamOptions()).of([camera.name for camera in cameras])
        write_rig(output, Recording(output, rig, sources), overwrite)
    except CalibrationError:
        _require_front(foreign, rig, world)
        raise
    print(_world_line(world, unit, up))
    for camera in cameras:
        print(_line(camera))
    print(f"wrote {output}")


import_calibration.__doc__ = (import_calibration.__doc__ or "").replace("{formats}", help_text())


def _read(format: str, files: Sequence[str], options: ImportOptions) -> list[ForeignCamera]:
    """The cameras, as their calibrations have them."""
    if format not in FORMATS:
        raise ConfigError("calibrate import", "FORMAT", repr(format), one_of(format, FORMATS))
    if not files:
        raise ConfigError("calibrate import", "FILE", "nothing", "one calibration a camera")
    groups = [[Path(part) for part in file.split("+")] for file in files]
    return [camera for group in groups for camera in read_cameras(format, group, options)]


def _named(cameras: Sequence[ForeignCamera], files: Sequence[str], given: str | None) -> list[ForeignCamera]:
    if given is not None:
        names = words("--names", given, len(cameras))
    elif all(camera.name for camera in cameras):
        names = [camera.name for camera in cameras]
    else:
        names = camera_names([Path(file.partition("+")[0]) for file in files])
        if len(set(names)) < len(names):
            raise ConfigError("--names", "", "files and folders that share their names", "a name for each camera")
        if len(names) != len(cameras):
            found = f"{len(cameras)} cameras in {len(names)} files, not all with a name"
            raise ConfigError("--names", "", found, "a name for each camera")
    return [replace(camera, name=name) for camera, name in zip(cameras, names, strict=True)]


def _world(cameras: Sequence[ForeignCamera], unit: str | None, up: str | None, mirrored: bool) -> World:
    given: dict[str | None, Up] = {one: one for one in get_args(Up)} | {one[1]: one for one in ("+x", "+y", "+z")}
    upward = given[up] if up else guess_up(cameras, mirrored)
    world = World(unit or guess_unit(cameras, upward, mirrored), upward, mirrored)
    require_median_height(cameras, world)
    return world


def _size(camera: ForeignCamera, shared: tuple[int, int] | None) -> tuple[int, int]:
    if camera.size is None and shared is None:
        raise ConfigError("--size", "", "nothing", f"width,height of the images: {camera.file} does not say it")
    if camera.size is not None and shared is not None and camera.size != shared:
        found = f"{shared[0]},{shared[1]}"
        raise ConfigError("--size", camera.name, found, f"{camera.size[0]},{camera.size[1]}, as {camera.file} says")
    return camera.size or shared or (0, 0)


def _require_front(foreign: Sequence[ForeignCamera], rig: Rig, world: World) -> None:
    """Name a mirrored world, in which the cameras that look at the area have it behind them, and an area left in it."""
    (x0, x1), (y0, y1) = rig.grid.x, rig.grid.y
    if world.mirrored and _sees_area(replace(rig, grid=replace(rig.grid, y=(-y1, -y0), polygon=None))):
        reversed_area = f"--area={x0:g},{-y1:g},{x1:g},{-y0:g}: --mirrored reverses y"
        raise ConfigError("--area", "", f"an area that no view shows, y {y0:g} to {y1:g}", reversed_area)
    if all(is_mirrored(camera, rig.grid) for camera in rig.cameras):
        found = "a mirrored world, in which the area lies behind every camera"
        undo = "without --mirrored" if world.mirrored else "--mirrored, where the calibration is left-handed"
        raise CalibrationError(foreign[0].file, "handedness", found, f"the area before the cameras: {undo}, or --up")


def _sees_area(rig: Rig) -> bool:
    try:
        rig.require_coverage()
    except CalibrationError:
        return False
    return True


def _world_line(world: World, unit: str | None, up: str | None) -> str:
    length = f"in {world.unit}" if world.unit in UNITS else f"in units of {world.unit} m"
    words = [
        f"{length} ({'given' if unit else 'guessed: --unit'})",
        f"{world.up} up ({'given' if up else 'guessed: --up'})",
    ]
    return f"calibrated {', '.join(words)}{', mirrored' if world.mirrored else ''}"


def _line(camera: Camera) -> str:
    x, y, z = camera.centre
    height = f"{z:.2f} m above the ground" if z > 0 else f"{-z:.2f} m below the ground: is --up right?"
    return f"{camera.name}: at ({x:.2f}, {y:.2f}) m, {height}"
