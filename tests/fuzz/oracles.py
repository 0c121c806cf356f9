"""What a reader has accepted is within the stated limits, and the same once it is written and read again."""

from pathlib import Path

import numpy as np

from stseg.arrays import Boxes, Rows
from stseg.config import Config
from stseg.geometry import Camera
from stseg.io.config_file import as_toml, read_config
from stseg.io.recording.recording import Recording, Source
from stseg.io.recording.rig_text import format_rig
from stseg.io.recording.rigs import parse_rig
from stseg.io.recording.streams import open_stream
from stseg.io.track_csv import read_tracks_csv, write_truth_csv
from stseg.io.untrusted import limits


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
    assert limits.TOP[0] <= grid.top <= limits.TOP[1]
    assert grid.planes <= limits.PLANES
    assert np.abs([grid.x, grid.y]).max() <= limits.METRES
    assert len(recording.rig.cameras) <= limits.CAMERAS
    assert len({camera.name for camera in recording.rig.cameras}) == len(recording.rig.cameras)
    text = format_rig(recording, recording.path)
    assert format_rig(parse_rig(text, recording.path), recording.path) == text


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
    write_truth_csv(folder / "again.csv", rows, overwrite=True)
    again = read_tracks_csv(folder / "again.csv")
    for name in again.dtype.names or ():
        np.testing.assert_allclose(again[name], rows[name], atol=1e-4)
