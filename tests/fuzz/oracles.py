"""What a reader has accepted is within the stated limits, and the same once it is written and read again."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from stseg.arrays import Boxes, Floats, Rows
from stseg.config import Config
from stseg.geometry import Camera
from stseg.io.answers import AnswerRow
from stseg.io.calibrations.foreign_camera import ForeignCamera
from stseg.io.calibrations.point_files import PointTable
from stseg.io.config_file import as_toml, read_config
from stseg.io.recording.recording import Recording, Source
from stseg.io.recording.rig_text import format_rig
from stseg.io.recording.rigs import parse_rig
from stseg.io.recording.streams import open_stream
from stseg.io.runfile.runs import Run
from stseg.io.track_csv import read_tracks_csv
from stseg.io.untrusted import limits
from stseg.io.untrusted.values import is_name, is_title


def require_boxes(frames: list[Boxes], camera: Camera, folder: Path) -> None:
    """Boxes of the first frames."""
    lines = ["frame,left,top,width,height,score"]
    for frame, boxes in enumerate(frames):
        assert len(boxes) <= limits.BOXES_PER_FRAME
        assert (np.abs(boxes.pixel) <= limits.NUMBER).all(), boxes.pixel
        assert (boxes.pixel[:, 2:] >= 0).all(), boxes.pixel
        assert ((boxes.score >= 0) & (boxes.score <= 1)).all(), boxes.score
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


def require_rig(recording: Recording) -> None:
    """A rig and its sources."""
    grid = recording.rig.grid
    assert limits.FRAME_RATE[0] <= recording.rig.frame_rate <= limits.FRAME_RATE[1]
    assert limits.CELL[0] <= grid.cell <= limits.CELL[1]
    assert limits.TOP[0] <= grid.top <= limits.TOP[1] and grid.planes <= limits.PLANES
    assert np.abs([grid.x, grid.y]).max() <= limits.METRES and len(recording.rig.cameras) <= limits.CAMERAS
    assert len({camera.name for camera in recording.rig.cameras}) == len(recording.rig.cameras)
    text = format_rig(recording, recording.path)
    assert format_rig(parse_rig(text, recording.path), recording.path) == text


def require_numbers(most: float, *arrays: Floats) -> None:
    """Finite numbers up to a size."""
    for array in arrays:
        assert (np.abs(array) <= most).all(), array


def require_cameras(cameras: Sequence[ForeignCamera]) -> None:
    """Cameras of a calibration."""
    for camera in cameras:
        require_numbers(limits.NUMBER, camera.projection)
        assert camera.size is None or 0 < min(camera.size) <= max(camera.size) <= limits.SIDE


def require_points(tables: Sequence[PointTable]) -> None:
    """Correspondences of points."""
    assert sum(len(table.pixel) for table in tables) <= limits.POINTS
    assert all(is_name(table.camera) for table in tables)
    require_numbers(limits.NUMBER, *(array for table in tables for array in (table.pixel, table.place)))


def require_areas(areas: Sequence[tuple[str, tuple[Floats, ...]]]) -> None:
    """Zones or lines."""
    assert 0 < len({name for name, _ in areas if is_title(name)}) == len(areas) <= limits.AREAS
    assert all(2 <= len(part) <= limits.CORNERS for _, parts in areas for part in parts)
    require_numbers(limits.METRES, *(part for _, parts in areas for part in parts))


def require_answers(rows: Sequence[AnswerRow]) -> None:
    """Answers about tracks."""
    for row in rows:
        assert not row.name or is_title(row.name)
        assert all(0 <= number <= limits.FRAMES for number in (row.track, row.other, row.frame or 0))


def require_run(run: Run) -> None:
    """Frames and tracks of a run."""
    rows = run.trajectory
    assert (np.diff(run.frames) > 0).all() and len(np.unique(rows[["frame", "id"]])) == len(rows)
    require_numbers(limits.METRES, rows["x"], rows["y"])
    assert all(map(is_title, run.names.values()))


def require_config(config: Config, folder: Path) -> None:
    """Constants of all stages."""
    path = folder / "again.toml"
    path.write_text(as_toml(config), "utf-8")
    assert read_config(path) == config


def require_tracks(rows: Rows, folder: Path) -> None:
    """Tracks or truth."""
    assert (np.abs(rows["frame"]) <= limits.FRAMES).all()
    assert all((np.abs(rows[name]) <= limits.NUMBER).all() for name in ("x", "y"))
    assert len(np.unique(rows[["frame", "id"]])) == len(rows)
    np.savetxt(folder / "again.csv", rows, "%d,%d,%.4f,%.4f,%d", header="frame,id,x,y,flag", comments="")
    again = read_tracks_csv(folder / "again.csv")
    for name in again.dtype.names or ():
        np.testing.assert_allclose(again[name], rows[name], atol=1e-4)
