"""`stseg calibrate`: make a rig file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import App, Parameter

from stseg.errors import ConfigError, OutputError
from stseg.geometry import Camera, Grid, Rig
from stseg.io.calibrations.opencv_xml import read_opencv_xml
from stseg.io.calibrations.projection import read_projection
from stseg.io.calibrations.world import Unit, Up, World
from stseg.io.recording import CameraSource, Recording, Source, SourceKind
from stseg.io.rigs import write_rig

app = App(name="calibrate", help="Make a rig file.")


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Scene:
    """What the rig file says of the scene and the grid."""

    area: Annotated[str, Parameter(metavar="X0,Y0,X1,Y1", allow_leading_hyphen=True)]
    """Ground rectangle to watch, metres."""
    frame_rate: float
    """Frames per second of the recording."""
    scene: str | None = None
    """Name of the scene; without it, the rig file's name."""
    polygon: Annotated[str | None, Parameter(metavar="X,Y,X,Y,...", allow_leading_hyphen=True)] = None
    """Corners of the part of the area that counts, metres."""
    cell: float = Grid.cell
    """Side of a ground cell, metres."""
    top: float = Grid.top
    """Height of the uppermost plane, metres."""
    planes: int = Grid.planes
    """Number of planes from the ground to the top."""

    @property
    def grid(self) -> Grid:
        """The grid; bounds in the wrong order are left to the rig file's checks."""
        x0, y0, x1, y1 = _numbers("--area", self.area, "4 numbers x0,y0,x1,y1", 4)
        corners = None
        if self.polygon is not None:
            flat = _numbers("--polygon", self.polygon, "x,y of at least 3 corners")
            if len(flat) < 6 or len(flat) % 2:
                raise ConfigError("--polygon", "", f"{len(flat)} numbers", "x,y of at least 3 corners")
            corners = np.array(flat).reshape(-1, 2)
        return Grid((x0, x1), (y0, y1), self.cell, self.top, self.planes, corners)


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Streams:
    """What the rig file says of the frames."""

    source_pattern: Annotated[str | None, Parameter(metavar="PATTERN")] = None
    """Path of every camera's frames, `{name}` standing for the camera's name."""
    sources: Annotated[str | None, Parameter(metavar="A,B,...")] = None
    """Paths of the frames one by one, instead of a pattern."""
    source_kind: SourceKind = "video"
    """What these frames are."""
    first_frame: int | None = None
    """Number of the first frame in boxes files; without it, 0."""
    background: Annotated[str | None, Parameter(metavar="PATTERN")] = None
    """Path of every camera's view of the empty scene, `{name}` standing for the camera's name."""
    background_kind: Literal["video", "images"] = "video"
    """What the views of the empty scene are."""

    def of(self, names: Sequence[str]) -> tuple[CameraSource, ...]:
        """The streams of these cameras."""
        if self.first_frame is not None and self.source_kind != "boxes":
            raise ConfigError(
                "--first-frame", "", f"--source-kind {self.source_kind}", "boxes: frames count from 0 else"
            )
        return tuple(
            CameraSource(Source(self.source_kind, path, self.first_frame or 0), self._background_of(name))
            for name, path in zip(names, self._paths(names), strict=True)
        )

    def _paths(self, names: Sequence[str]) -> list[Path]:
        if self.sources is not None and self.source_pattern is None:
            return [Path(path) for path in _words("--sources", self.sources, len(names))]
        if self.source_pattern is None or self.sources is not None:
            raise ConfigError("--source-pattern, --sources", "", "both or neither", "one of them")
        if len(names) > 1 and "{name}" not in self.source_pattern:
            raise ConfigError("--source-pattern", "", repr(self.source_pattern), "a path with {name} in it")
        return [_filled(self.source_pattern, name) for name in names]

    def _background_of(self, name: str) -> Source | None:
        return None if self.background is None else Source(self.background_kind, _filled(self.background, name))


@app.command(name="import")
def import_calibration(
    format: Literal["opencv", "matrix"],
    /,
    *files: Annotated[str, Parameter(metavar="FILE...")],
    output: Annotated[Path, Parameter(name=["--output", "-o"], metavar="RIG.toml")],
    size: Annotated[str, Parameter(metavar="W,H")],
    unit: Unit,
    scene: Scene,
    streams: Streams | None = None,
    up: Annotated[Up, Parameter(allow_leading_hyphen=True)] = "+z",
    names: Annotated[str | None, Parameter(metavar="A,B,...")] = None,
    overwrite: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Make a rig file from the calibrations of other programs.

    **opencv**: one FileStorage XML a camera, or two joined with a plus sign (`intrinsic.xml+extrinsic.xml`).

    **matrix**: one 3x4 projection matrix a camera, as .txt, .csv, .npy, .npz or .mat (version 7.3).

    Four cameras with silhouettes, calibrated in millimetres with Z pointing down:

    ```
    stseg calibrate import opencv cam*/config.xml -o room.toml \\
        --size 644,486 --unit mm --up=-z --area=-2.5,-4.5,2.5,1.5 --frame-rate 5 \\
        --source-pattern '{name}/silhouettes.avi' --source-kind masks
    ```

    Parameters
    ----------
    format
        What the calibrations are.
    files
        One calibration a camera.
    output
        The rig file to write.
    size
        Width and height of the images, pixels.
    unit
        Unit of length of the calibrations.
    up
        Which way their Z axis points away from the ground. With -z, X = x, Y = -y, Z = -z.
    names
        Names of the cameras; without them, those of the files, or of their folders where all files are called the same.
    overwrite
        Replace the rig file if it exists.
    """
    if output.exists() and not overwrite:
        raise OutputError(output, "", "a file that exists", "a new name, or --overwrite")
    groups = _groups(format, files)
    camera_names = _camera_names(groups, names)
    width, height = _size(size)
    world = World(unit, up)
    cameras = tuple(
        _camera(format, group, name, (width, height), world) for group, name in zip(groups, camera_names, strict=True)
    )
    rig = Rig(scene.scene or output.stem, scene.frame_rate, scene.grid, cameras)
    write_rig(output, Recording(output, rig, (streams or Streams()).of(camera_names)))
    for camera in cameras:
        print(_line(camera))
    print(f"wrote {output}")


def _groups(format: str, files: Sequence[str]) -> list[tuple[Path, ...]]:
    """The files of each camera."""
    if not files:
        raise ConfigError("calibrate import", "FILE", "nothing", "one calibration a camera")
    if format == "opencv":
        return [tuple(Path(part) for part in file.split("+")) for file in files]
    return [(Path(file),) for file in files]


def _camera_names(groups: Sequence[tuple[Path, ...]], given: str | None) -> list[str]:
    if given is not None:
        return _words("--names", given, len(groups))
    stems = [group[0].stem for group in groups]
    if len(set(stems)) == len(stems):
        return stems
    folders = [group[0].absolute().parent.name for group in groups]
    if len(set(folders)) == len(folders):
        return folders
    raise ConfigError("--names", "", "files and folders that share their names", "a name for each camera")


def _camera(format: str, files: tuple[Path, ...], name: str, size: tuple[int, int], world: World) -> Camera:
    if format == "opencv":
        return read_opencv_xml(files, name, size, world)
    return read_projection(files[0], name, size, world)


def _line(camera: Camera) -> str:
    x, y, z = camera.centre
    height = f"{z:.2f} m above the ground" if z > 0 else f"{-z:.2f} m below the ground: is --up right?"
    return f"{camera.name}: at ({x:.2f}, {y:.2f}) m, {height}"


def _filled(pattern: str, name: str) -> Path:
    return Path(pattern.replace("{name}", name))


def _size(text: str) -> tuple[int, int]:
    width, height = _numbers("--size", text, "width,height in whole pixels", 2)
    if width != int(width) or height != int(height) or min(width, height) < 1:
        raise ConfigError("--size", "", repr(text), "width,height in whole pixels")
    return int(width), int(height)


def _words(option: str, text: str, count: int) -> list[str]:
    words = [word.strip() for word in text.split(",")]
    if len(words) != count:
        raise ConfigError(option, "", f"{len(words)} of them", f"{count}, one a camera")
    return words


def _numbers(option: str, text: str, expected: str, count: int | None = None) -> list[float]:
    try:
        numbers = [float(word) for word in text.split(",")]
    except ValueError as error:
        raise ConfigError(option, "", repr(text), expected) from error
    if (count is not None and len(numbers) != count) or not np.isfinite(numbers).all():
        raise ConfigError(option, "", repr(text), expected)
    return numbers
