"""The rig file: the scene, the grid, the cameras and their streams, as TOML that people read and write.

Everything is checked on load, and no later stage checks again. Errors name the file, the key (cameras count from 0),
the value found and the value expected. Paths in the file are relative to it.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields, replace
from pathlib import Path
from typing import Literal

import numpy as np

from stseg.errors import CalibrationError, OutputError, RigError
from stseg.geometry import Camera, Grid, Lens, Rig
from stseg.geometry.lens import COEFFICIENTS
from stseg.io.detections.tables import COLUMNS
from stseg.io.lenses import checked_lens
from stseg.io.outputs.whole_files import MARK, Inputs, require_output, write_file
from stseg.io.recording.recording import (
    HOG,
    SOURCE_KINDS,
    BodyPrior,
    CameraSource,
    ClockSource,
    Recording,
    Source,
    SourceKind,
)
from stseg.io.recording.rig_text import FORMAT, format_rig
from stseg.io.recording.source_files import recording_files
from stseg.io.toml import ANY, Table, parse_toml
from stseg.io.untrusted import limits
from stseg.io.untrusted.bounded_files import read_text, reading

_ON_MISSING: tuple[Literal["error", "blind"], ...] = ("error", "blind")
_CLOCKS: tuple[ClockSource, ...] = ("auto", "stamps", "count")
_CAMERA_KEYS = (
    *("name", "size", "ground", "vertical", "projection", "lens"),
    *("offset", "source", "images", "background", "on_missing", "clock"),
)
_DETECTOR_KEYS = ("detector", "features", "classes", "score")
_DETECTION_KEYS = ("first_frame", "frames", "classes", "score", "view", "select", "image_list", "columns", "appearance")


def read_recording(path: str | Path) -> Recording:
    """Read and check a rig file.

    Parameters
    ----------
    path
        The file. Paths in it are relative to its folder.

    Raises
    ------
    RigError
        Where the file is missing, no TOML, or has a value out of its range.
    CalibrationError
        Where a camera's geometry is singular or sees nothing of the area.
    """
    path = Path(path)
    with reading(path, "a rig file in TOML", RigError):
        text = read_text(path)
    return parse_rig(text, path)


def parse_rig(text: str, path: Path) -> Recording:
    """`read_recording` of a text that belongs to the file `path`."""
    try:
        top = Table(path, "", parse_toml(text))
    except ValueError as error:
        raise RigError(path, "", f"what is not TOML ({error})", "TOML") from error
    top.require("format", FORMAT, f"{FORMAT}, the format that this version reads")
    top.allow("format", "scene", "grid", "body", "camera")
    scene, tables = top.table("scene"), _named(top.tables("camera", limits.CAMERAS))
    scene.allow("name", "frame_rate", "x", "y", "polygon", "doors", "closed")
    grid = _grid(scene, top.table("grid"))
    with np.errstate(all="ignore"):  # what overflows fails the checks of the geometry
        cameras = tuple(_camera(table) for table in tables)
        rate, doors = scene.within("frame_rate", limits.FRAME_RATE), _doors(scene, grid)
        rig = Rig(scene.name("name"), rate, grid, cameras, doors, "closed" in scene and scene.truth("closed"))
        for table, camera in zip(tables, cameras, strict=True):
            with _placed(table, "projection" in table):
                replace(rig, cameras=(camera,)).require_coverage()
    body = _body(top.table("body")) if "body" in top else BodyPrior()
    return Recording(path, rig, tuple(_camera_source(table) for table in tables), body)


def write_rig(path: str | Path, recording: Recording, overwrite: bool = False) -> None:
    """Write a rig file; `read_recording` gives back the same recording, to the last bit.

    Paths of streams are written relative to the file, unless they are absolute and lie elsewhere. With `overwrite` an
    older file that stseg wrote is replaced, whole or not at all.

    Raises
    ------
    RigError, CalibrationError
        Where `read_recording` would refuse the file; nothing is written then.
    OutputError
        Where the file cannot be written.
    """
    path = Path(path)
    text = f"# {MARK.decode()}\n{format_rig(recording, path)}"
    parse_rig(text, path)
    try:
        data = text.encode("utf-8")
    except UnicodeEncodeError as error:
        raise OutputError(path, "", "a name that UTF-8 cannot hold", "names of readable characters") from error
    require_output(path, overwrite, Inputs(recording_files(replace(recording, path=Path()))))
    write_file(path, data, overwrite)


def _named(tables: tuple[Table, ...]) -> tuple[Table, ...]:
    """The cameras' tables, with camera names in their places for errors; names are unique."""
    names = [table.name("name") for table in tables]
    for index, (table, name) in enumerate(zip(tables, names, strict=True)):
        if name in names[:index]:
            raise table.error("name", f"{name!r}, the name of camera[{names.index(name)}] too", "a name of its own")
    return tuple(replace(table, place=f"{table.place} ({name})") for table, name in zip(tables, names, strict=True))


def _body(table: Table) -> BodyPrior:
    names = tuple(one.name for one in fields(BodyPrior))
    table.allow(*names)
    given = {name: table.within(name, limits.BODY) for name in names if name in table}
    for size in ("height", "width"):
        mean, spread = given.get(f"{size}_mean"), given.get(f"{size}_spread")
        if mean is not None and spread is not None and mean <= 2 * spread:
            raise table.error(f"{size}_spread", repr(spread), f"less than half of {size}_mean")
    return BodyPrior(**given)


def _grid(scene: Table, table: Table) -> Grid:
    table.allow("cell", "top", "planes")
    polygon = None
    if "polygon" in scene:
        polygon = scene.numbers("polygon", ANY, 2, largest=limits.METRES)
        if not 3 <= len(polygon) <= limits.CORNERS:
            raise scene.error("polygon", f"{len(polygon)} corners", f"3 to {limits.CORNERS}")
    grid = Grid(
        x=_bounds(scene, "x"),
        y=_bounds(scene, "y"),
        cell=table.within("cell", limits.CELL),
        top=table.within("top", limits.TOP),
        planes=table.integer("planes", 1, limits.PLANES),
        polygon=polygon,
    )
    planes, rows, columns = grid.shape
    if max(rows, columns) > limits.AXIS_CELLS or rows * columns > limits.GROUND_CELLS:
        expected = f"at most {limits.AXIS_CELLS} along a side and {limits.GROUND_CELLS:.0e} in all"
        raise table.error("cell", f"{grid.cell!r}, which makes {columns} x {rows} cells on the ground", expected)
    if planes * rows * columns > limits.CELLS:
        found = f"{grid.cell!r}, which makes {planes * rows * columns:.1e} cells"
        raise table.error("cell", found, f"at most {limits.CELLS:.0e}, planes included")
    if not grid.inside().any():
        raise scene.error("polygon", "a polygon that holds no cell", "one that overlaps the rectangle x, y")
    return grid


def _doors(scene: Table, grid: Grid) -> tuple[tuple[float, float, float, float], ...]:
    if "doors" not in scene:
        return ()
    doors = scene.numbers("doors", ANY, 4, largest=limits.METRES)
    if len(doors) > limits.AREAS:
        raise scene.error("doors", f"{len(doors)} doors", f"at most {limits.AREAS}")
    found = [(float(x0), float(y0), float(x1), float(y1)) for x0, y0, x1, y1 in doors]
    for door in found:
        if door[0] > door[2] or door[1] > door[3] or not (grid.touching(door) & grid.inside()).any():
            raise scene.error("doors", list(door), "x0, y0, x1, y1: lower, then upper bounds, of a part of the area")
    return tuple(found)


def _bounds(table: Table, name: str) -> tuple[float, float]:
    low, high = table.numbers(name, 2, largest=limits.METRES).tolist()
    if not low < high:
        raise table.error(name, [low, high], "the lower bound, then the upper")
    return low, high


def _camera(table: Table) -> Camera:
    table.allow(*_CAMERA_KEYS)
    name = table.text("name")
    size = table.image_size("size")
    lens = _lens(table.table("lens")) if "lens" in table else None
    by_projection = "projection" in table
    if by_projection and ("ground" in table or "vertical" in table):
        raise table.error("projection", "ground or vertical beside it", "either projection, or ground and vertical")
    if not by_projection and "ground" not in table:
        raise table.error("ground", "nothing", "a homography (ground and vertical), or projection")
    with _placed(table, by_projection):
        if by_projection:
            return Camera.from_projection(name, size, table.numbers("projection", 3, 4), lens)
        return Camera(name, size, table.numbers("ground", 3, 3), table.numbers("vertical", 3), lens)


@contextmanager
def _placed(table: Table, by_projection: bool) -> Iterator[None]:
    """Add the file and key to a calibration error."""
    try:
        yield
    except CalibrationError as error:
        key = table.key("projection" if by_projection else error.key)
        raise CalibrationError(table.file, key, error.found, error.expected) from error


def _lens(table: Table) -> Lens:
    table.allow("model", "matrix", "distortion")
    model = table.choice("model", COEFFICIENTS) if "model" in table else "pinhole"
    return checked_lens(table.numbers("matrix", 3, 3), table.numbers("distortion", ANY), model, table.error)


def _camera_source(table: Table) -> CameraSource:
    on_missing = table.choice("on_missing", _ON_MISSING) if "on_missing" in table else "error"
    background = _source(table.table("background")) if "background" in table else None
    if background is not None and background.kind not in ("video", "images"):
        raise table.error("background.kind", repr(background.kind), "video or images: the empty scene in colour")
    offset = table.integer("offset", -limits.FRAMES, limits.FRAMES) if "offset" in table else 0
    clock = table.choice("clock", _CLOCKS) if "clock" in table else "auto"
    source = _source(table.table("source"), "starts")
    images = _source(table.table("images")) if "images" in table else None
    if images is not None and (images.kind not in ("video", "images") or source.kind not in ("boxes", "instances")):
        raise table.error("images.kind", repr(images.kind), "video or images, beside a source of boxes or instances")
    return CameraSource(source, background, offset, on_missing, clock, images)


def _source(table: Table, *more_keys: str) -> Source:
    kind = table.choice("kind", SOURCE_KINDS)
    detections = kind in ("boxes", "instances")
    keys = _DETECTION_KEYS if detections else _DETECTOR_KEYS if kind in ("video", "images") and more_keys else ()
    table.allow("kind", "path", *keys, *(() if kind == "boxes" else more_keys))
    detector = _detector(table) if "detector" in table else None
    unused = [key for key in ("features", "classes", "score") if key in table and detector is None and not detections]
    if unused:
        raise table.error(unused[0], f"{unused[0]} of no boxes", "a detector beside them")
    paths = table.paths()
    if any("://" in name for name in paths):
        return _live_source(table, kind)
    first, *more = [table.file.parent / name for name in paths]
    if more and kind == "boxes":
        raise table.error("path", f"{len(more) + 1} files", "one file of boxes")
    return Source(
        kind,
        first,
        table.integer("first_frame", -limits.FRAMES, limits.FRAMES) if "first_frame" in table else 0,
        table.integer("frames", 1, limits.FRAMES) if "frames" in table else None,
        tuple(more),
        tuple(table.numbers("starts", ANY).tolist()) if "starts" in table else (),
        classes=tuple(table.texts("classes")) if "classes" in table else (),
        least_score=table.within("score", (0.0, 1.0)) if "score" in table else 0.0,
        view=table.integer("view", 0, limits.CAMERAS) if "view" in table else None,
        select=table.text("select") if "select" in table else "",
        image_list=table.file.parent / table.text("image_list") if "image_list" in table else None,
        columns=_columns(table.table("columns")) if "columns" in table else (),
        appearance=table.file.parent / table.text("appearance") if "appearance" in table else None,
        detector=detector,
        features=table.file.parent / table.text("features") if "features" in table else None,
    )


def _detector(table: Table) -> Path:
    """The model of a detector, or the one that needs no file."""
    if "starts" in table or any("://" in name for name in table.paths()):
        found = "a detector of files with gaps between them" if "starts" in table else "a detector of a live stream"
        raise table.error("detector", found, "files that follow one another, or no detector")
    name = table.text("detector")
    return HOG if name == str(HOG) else table.file.parent / name


def _columns(table: Table) -> tuple[tuple[str, str], ...]:
    table.allow(*COLUMNS)
    return tuple((name, table.text(name)) for name in table.values)


def _live_source(table: Table, kind: SourceKind) -> Source:
    address, *more = table.paths()
    if kind != "video" or more:
        found = f"{address} of kind {kind}" if kind != "video" else f"{len(more) + 1} streams"
        raise table.error("path", found, "one address, of kind video")
    return Source(kind, Path(address.rpartition("/")[2]), address=address)
