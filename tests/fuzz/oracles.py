"""What a reader has accepted is within the stated limits, and the same once it is written and read again."""

import csv
import re
import tomllib
from collections.abc import Sequence
from io import StringIO
from itertools import pairwise
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from stseg import Boxes, Camera, Config, InputError, Recording, Run, Source, StsegError, read_config, read_tracks_csv
from stseg.arrays import Floats, Rows
from stseg.identities.review.corrections import ACTIONS
from stseg.io.answers import AnswerRow
from stseg.io.calibrations.foreign_camera import ForeignCamera
from stseg.io.calibrations.point_files import PointTable
from stseg.io.config_file import as_toml
from stseg.io.recording.rig_text import format_rig
from stseg.io.recording.rigs import parse_rig
from stseg.io.recording.streams import open_stream
from stseg.io.runfile import layout
from stseg.io.untrusted import limits

_LINE = 1000
"""Characters of a refusal: values are shown in part."""
_WHOLE = re.compile(
    r"(<|what|something|bytes|no|nothing|numbers|a broken|an image|JSON of|Unable|\d+ (arrays|lines))\b"
)
"""How a refusal of a whole file begins, which names no key."""
_OTHER_FORMS = ("path", "ground", "vertical", "projection")
_DEFAULTS: tuple[object, ...] = (False, 0, [])


def is_title(text: str) -> bool:
    """Whether a text can be shown as a name; said here anew, so that no check of the program vouches for itself."""
    is_number = re.fullmatch(r"[-+]\d*\.?\d*(e[-+]?\d+)?", text, re.ASCII | re.IGNORECASE)
    is_plain = 0 < len(text) <= limits.NAME and text.isprintable() and text == text.strip()
    return is_plain and bool(is_number or not set("=+-@") & set(text[0]))


def is_name(text: str) -> bool:
    """Whether a text can be a file's name, too."""
    return is_title(text) and len(text.encode()) < 250 and text.strip(".") != "" and not {"/", "\\"} & set(text)


def require_line(error: StsegError, folder: Path) -> None:
    """A refusal: one short line that names the file, the key, and what is wrong there in words of the format."""
    line = str(error).replace(str(folder), "")
    assert line.isprintable() and len(line) <= _LINE, line
    assert isinstance(error, InputError) and error.expected, line
    assert str(folder) in str(error) or folder == Path(), line
    assert "a value of another type or size" not in line, line  # the net below the formats' own checks
    assert error.key or _WHOLE.match(error.found), line


def require_place(error: StsegError, valid: bytes, data: bytes) -> None:
    """Where one row of a valid table was changed, a refusal names its line, or the frame in it."""
    before, after = valid.splitlines(), data.splitlines()
    changed = [number for number, (line, one) in enumerate(zip(before, after, strict=False), 1) if line != one]
    if isinstance(error, InputError) and error.key and len(before) == len(after) and len(changed) == 1 < changed[0]:
        frame = error.key.startswith("frame ") and error.key.encode()[6:] in after[changed[0] - 1]
        assert frame or re.search(rf"line {changed[0]}\b|in the same|twice", str(error)), error


def rows_of(path: Path) -> list[list[str]]:
    """Rows of CSV that are not blank."""
    rows = csv.reader(StringIO(path.read_text("utf-8-sig"), newline=""), skipinitialspace=True)
    return [row for row in rows if any(map(str.strip, row))]


def require_json(value: Any, size: tuple[int, int]) -> None:
    """Objects of JSON: images of a size, numbers of frames within limits, keyframes that rise."""
    for one in value if isinstance(value, list) else []:
        require_json(one, size)
    if isinstance(value, dict):
        sides = (value.get("width"), value.get("height")) if "file_name" in value else size
        assert sides == size or not all(isinstance(side, int) and side > 0 for side in sides), sides
        keys = [step["frame"] for step in value.get("sequence", []) if "frame" in step]
        assert all(first < later for first, later in pairwise(keys)), keys
        assert all(abs(float(value.get(name, 0))) <= limits.FRAMES for name in ("framesCount", "image_id")), value
        require_json(list(value.values()), size)


def require_table(path: Path, least: float) -> None:
    """A table that was accepted: no column twice, no row wider than the header, whole frames from `least` on."""
    header, *rows = rows_of(path)
    names = [name.strip().lower() for name in header]
    if header[0][:1] in "-.0123456789":  # lines of MOTChallenge
        rows, names = [re.split("[ ,]+", ",".join(row).strip()) for row in [header, *rows]], ["frame", "id"]
        if len(rows[0]) == 9:  # the truth of MOTChallenge
            return
        assert float(rows[0][1]).is_integer()
    else:
        assert all(names.count(name) < 2 for name in names if name), names
        assert not any(cell.strip() for row in rows for cell in row[len(names) :]), rows
    frames = [float(row[names.index("frame")] or 0) for row in rows if "frame" in names]
    assert all(frame.is_integer() and least <= frame <= limits.FRAMES for frame in frames), frames


def require_kept(given: Any, written: Any) -> None:
    """Every value of a table stands in what was written of it, but for defaults and other forms of geometry."""
    if isinstance(given, dict):
        for key, value in given.items():
            if key not in _OTHER_FORMS and (key in written or value not in _DEFAULTS):
                require_kept(value, written[key])
    elif isinstance(given, list) and isinstance(next(iter(given), 0), dict):
        for one, other in zip(given, written, strict=True):
            require_kept(one, other)
    else:
        given = float(given) if type(given) is int else given  # of hundreds of digits
        np.testing.assert_array_equal(np.ravel(written)[: np.size(given)], np.ravel(given))


def require_boxes(frames: list[Boxes], camera: Camera, folder: Path, most: float) -> None:
    """Boxes of the first frames, of numbers up to a size."""
    lines = ["frame,left,top,width,height,score"]
    for frame, boxes in enumerate(frames):
        assert len(boxes) <= limits.BOXES_PER_FRAME
        assert (np.abs(boxes.pixel) <= most).all(), boxes.pixel
        assert (boxes.pixel[:, 2:] >= 0).all() and ((boxes.score >= 0) & (boxes.score <= 1)).all(), boxes
        table = np.column_stack([boxes.pixel, boxes.score]).tolist()
        lines += [",".join([str(frame), *map(repr, row)]) for row in table]
    path = folder / "again.csv"
    path.write_text("\n".join(lines))
    stream = open_stream(Source("boxes", path, frames=len(frames)), camera)
    for boxes in frames if len(lines) > 1 else []:
        again = stream.read()
        assert isinstance(again, Boxes)
        np.testing.assert_array_equal(again.pixel, boxes.pixel)
        np.testing.assert_array_equal(again.score, boxes.score)


def require_rig(recording: Recording, path: Path) -> None:
    """A rig and its sources, as they were given."""
    grid = recording.rig.grid
    assert limits.FRAME_RATE[0] <= recording.rig.frame_rate <= limits.FRAME_RATE[1]
    assert limits.CELL[0] <= grid.cell <= limits.CELL[1]
    assert limits.TOP[0] <= grid.top <= limits.TOP[1] and grid.planes <= limits.PLANES
    assert np.abs([grid.x, grid.y]).max() <= limits.METRES and len(recording.rig.cameras) <= limits.CAMERAS
    names = [camera.name for camera in recording.rig.cameras]
    assert len(set(names)) == len(names) and all(map(is_name, names))
    assert all(0 < min(one.size) <= max(one.size) <= limits.SIDE for one in recording.rig.cameras)
    assert grid.inside().any() and grid.x[0] < grid.x[1] and grid.y[0] < grid.y[1]
    text = format_rig(recording, recording.path)
    assert format_rig(parse_rig(text, recording.path), recording.path) == text
    require_kept(tomllib.loads(path.read_text("utf-8-sig", "replace")), tomllib.loads(text))


def require_numbers(most: float, *arrays: Floats) -> None:
    for array in arrays:
        assert (np.abs(array) <= most).all(), array


def require_cameras(cameras: Sequence[ForeignCamera], path: Path) -> None:
    """Cameras of a calibration; NumPy's own reader has the same numbers."""
    assert 0 < len(cameras) <= limits.CAMERAS
    if path.suffix in (".npy", ".npz") and path.read_bytes()[:2] in (b"\x93N", b"PK"):  # else NumPy sees none
        found = np.load(path, allow_pickle=False)
        arrays = [found] if path.suffix == ".npy" else [found[name] for name in found.files]
        assert any(np.array_equal(array, cameras[0].projection) for array in arrays)
    for camera in cameras:
        require_numbers(limits.NUMBER, camera.projection)
        if camera.lens is not None and np.linalg.cond(camera.lens.matrix) < 1e9:
            turn = np.linalg.solve(camera.lens.matrix, camera.projection[:, :3])
            assert np.abs(turn @ turn.T - np.eye(3)).max() < 0.02 and np.linalg.det(turn) > 0, turn
        assert not camera.name or is_name(camera.name)
        assert path.suffix != ".xml" or np.linalg.det(camera.projection[:, :3]) > 0  # no mirror
        assert camera.size is None or 0 < min(camera.size) <= max(camera.size) <= limits.SIDE


def require_points(tables: Sequence[PointTable]) -> None:
    assert 0 < sum(len(table.pixel) for table in tables) <= limits.POINTS
    assert all(is_name(table.camera) and len(table.pixel) for table in tables)
    require_numbers(limits.NUMBER, *(array for table in tables for array in (table.pixel, table.place)))


def require_areas(areas: Sequence[tuple[str, tuple[Floats, ...]]]) -> None:
    assert 0 < len({name for name, _ in areas if is_title(name)}) == len(areas) <= limits.AREAS
    assert all(2 <= len(part) <= limits.CORNERS for _, parts in areas for part in parts)
    require_numbers(limits.METRES, *(part for _, parts in areas for part in parts))


def require_answers(rows: Sequence[AnswerRow]) -> None:
    for row in rows:
        assert (not row.name or is_title(row.name)) and row.action in ACTIONS, row
        assert all(0 <= number <= limits.FRAMES for number in (row.track, row.other, row.frame or 0))


def require_run(run: Run) -> None:
    rows = run.trajectory
    with h5py.File(run.path) as file:
        assert (file.attrs["format"], file.attrs["format_version"]) == (layout.FORMAT, layout.VERSION)
    assert (np.diff(run.frames) > 0).all() and len(np.unique(rows[["frame", "id"]])) == len(rows)
    assert np.isin(rows["frame"], run.frames).all() and np.isfinite(rows["height"]).all()
    assert not any((np.isinf(rows[name]) | (rows[name] < 0)).any() for name in ("height", "width", "xx", "yy"))
    assert len(run.cameras) == len(set(run.cameras)) and all(map(is_name, run.cameras))
    known = dict(zip(*np.unique(rows["id"], return_counts=True), strict=True))
    assert all(one["first"] <= one["last"] for one in run.tracks) and set(run.tracks["id"].tolist()) == set(known)
    require_numbers(limits.METRES, rows["x"], rows["y"], run.heights, run.ground_x, run.ground_y)
    assert all(map(is_title, run.names.values()))


def require_config(config: Config, given: Path) -> None:
    """Constants of all stages, as they were given."""
    path = given.with_name("again.toml")
    path.write_text(as_toml(config), "utf-8")
    assert read_config(path) == config
    require_kept(tomllib.loads(given.read_text("utf-8-sig")), tomllib.loads(path.read_text("utf-8")))


def require_tracks(rows: Rows, folder: Path) -> None:
    assert (np.abs(rows["frame"]) <= limits.FRAMES).all()
    assert all((np.abs(rows[name]) <= limits.NUMBER).all() for name in ("x", "y"))
    assert len(np.unique(rows[["frame", "id"]])) == len(rows)
    np.savetxt(folder / "again.csv", rows, "%d,%d,%.4f,%.4f,%d", header="frame,id,x,y,flag", comments="")
    again = read_tracks_csv(folder / "again.csv")
    for name in again.dtype.names or ():
        np.testing.assert_allclose(again[name], rows[name], atol=1e-4)
