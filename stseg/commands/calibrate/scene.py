"""Options of `stseg calibrate` besides the cameras: scene, grid and streams."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter

from stseg.errors import ConfigError
from stseg.geometry import Grid
from stseg.io.recording.recording import CameraSource, Source, SourceKind
from stseg.io.untrusted import limits
from stseg.io.untrusted.values import abbreviated, parse_numbers, parse_pair


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class SceneOptions:
    """Scene and grid of the rig file."""

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
        """The grid."""
        x0, y0, x1, y1 = area_of(self.area)
        corners = None
        if self.polygon is not None:
            flat = numbers("--polygon", self.polygon, "x,y of at least 3 corners")
            if len(flat) < 6 or len(flat) % 2:
                raise ConfigError("--polygon", "", f"{len(flat)} numbers", "x,y of at least 3 corners")
            corners = np.array(flat).reshape(-1, 2)
        return Grid((x0, x1), (y0, y1), self.cell, self.top, self.planes, corners)


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class StreamOptions:
    """Streams of the rig file."""

    source_pattern: Annotated[str | None, Parameter(metavar="PATTERN")] = None
    """Path of every camera's frames, `{name}` standing for the camera's name; this or --sources is needed."""
    sources: Annotated[str | None, Parameter(metavar="A,B,...")] = None
    """Paths of the frames one by one, instead of a pattern."""
    source_kind: SourceKind = "video"
    """Kind of the frames."""
    first_frame: int | None = None
    """Number of the first frame in boxes files; without it, 0."""
    score: float | None = None
    """Least score of boxes that are kept, 0..1; without it, all are."""
    appearance: Annotated[str | None, Parameter(metavar="PATTERN")] = None
    """Path of the appearance features beside every camera's boxes, `{name}` standing for the camera's name."""
    background: Annotated[str | None, Parameter(metavar="PATTERN")] = None
    """Path of every camera's view of the empty scene, `{name}` standing for the camera's name."""
    background_kind: Literal["video", "images"] = "video"
    """Kind of the views of the empty scene."""

    def of(self, names: Sequence[str]) -> tuple[CameraSource, ...]:
        """The streams of these cameras."""
        given = {"--first-frame": self.first_frame, "--score": self.score, "--appearance": self.appearance}
        for option, value in given.items():
            if value is not None and self.source_kind != "boxes":
                raise ConfigError(option, "", f"--source-kind {self.source_kind}", "boxes")
        if self.score is not None and not 0 <= self.score <= 1:
            raise ConfigError("--score", "", repr(self.score), "a number of 0..1")
        return tuple(self._source_of(name, path) for name, path in zip(names, self._paths(names), strict=True))

    def _source_of(self, name: str, path: Path) -> CameraSource:
        appearance = None if self.appearance is None else _filled(self.appearance, name)
        empty = None if self.background is None else Source(self.background_kind, _filled(self.background, name))
        source = Source(
            self.source_kind, path, self.first_frame or 0, least_score=self.score or 0.0, appearance=appearance
        )
        return CameraSource(source, empty)

    def _paths(self, names: Sequence[str]) -> list[Path]:
        if self.sources is not None and self.source_pattern is None:
            return [Path(path) for path in words("--sources", self.sources, len(names))]
        if self.source_pattern is None or self.sources is not None:
            given = "neither" if self.sources is None else "both"
            raise ConfigError("--source-pattern, --sources", "", given, "one of them")
        if len(names) > 1 and "{name}" not in self.source_pattern:
            raise ConfigError("--source-pattern", "", repr(self.source_pattern), "a path with {name} in it")
        return [_filled(self.source_pattern, name) for name in names]


def _filled(pattern: str, name: str) -> Path:
    return Path(pattern.replace("{name}", name))


def size_of(text: str) -> tuple[int, int]:
    """Width and height from the command line."""
    size = parse_pair(text, 1, limits.SIDE)
    if size is None or size[0] * size[1] > limits.PIXELS:
        expected = f"width,height in whole pixels, at most {limits.PIXELS} in all"
        raise ConfigError("command line", "--size", abbreviated(text), expected)
    return size


def area_of(text: str) -> tuple[float, float, float, float]:
    """x0, y0, x1, y1 of an area, metres."""
    found = parse_numbers(text.split(","), limits.METRES)
    if found is None or len(found) != 4 or not (found[0] < found[2] and found[1] < found[3]):
        raise ConfigError("--area", "", abbreviated(text), "x0,y0,x1,y1 in metres with x0 below x1 and y0 below y1")
    return found[0], found[1], found[2], found[3]


def words(option: str, text: str, count: int) -> list[str]:
    """A number of words between commas."""
    found = [word.strip() for word in text.split(",")]
    if len(found) != count:
        raise ConfigError(option, "", f"{len(found)} of them", f"{count}, one a camera")
    return found


def numbers(option: str, text: str, expected: str) -> list[float]:
    """Finite numbers between commas."""
    found = parse_numbers(text.split(","))
    if found is None:
        raise ConfigError(option, "", abbreviated(text), expected)
    return found
