"""Small run files for tests: two cameras above a few cells, frames 10 to 15, two people."""

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from stseg.arrays import Ints, Labels, Rows, Singles
from stseg.geometry import Camera, Grid, Rig
from stseg.io.recording.recording import CameraSource, Recording, Source
from stseg.io.runfile.layout import LOG_ODDS_STEP, ghost_type
from stseg.io.runfile.run_writer import packed_volume
from stseg.io.runfile.runs import RunWriter
from stseg.records.tables import BOX, EVENT, RATES, TIMING, TRAJECTORY, WINDOW, Tracks

FRAMES = np.arange(10, 16)
CONFIG = "[detection]\nprior_log_odds = -3.0\n"
_ABOVE = np.array([[10.0, 0.0, -8.0, 34.0], [0.0, -10.0, -6.0, 34.0], [0.0, 0.0, -1.0, 5.0]])


def small_recording(folder: Path) -> Recording:
    """Two cameras 5 m above 0.6 m x 0.4 m of ground; the first one's stream exists."""
    cameras = tuple(Camera.from_projection(name, (16, 12), _ABOVE) for name in ("left", "right"))
    if not (folder / "left.avi").exists():
        (folder / "left.avi").write_bytes(b"12345")
    sources = tuple(CameraSource(Source("video", folder / f"{camera.name}.avi")) for camera in cameras)
    return Recording(folder / "rig.toml", Rig("hall", 5.0, Grid((0, 0.6), (0, 0.4), 0.1, 1.8, 3), cameras), sources)


def small_volume(frames: int = len(FRAMES)) -> tuple[Singles, Labels]:
    """Log-odds with an unseen cell, and labels of tracks 1 and 2; (frames, 3, 4, 6)."""
    log_odds = np.random.default_rng(0).normal(0, 3, (frames, 3, 4, 6)).astype(np.float32)
    log_odds = np.round(log_odds / np.float32(LOG_ODDS_STEP)) * np.float32(LOG_ODDS_STEP)
    log_odds[:, 0, 0, 0] = np.nan
    label = np.zeros(log_odds.shape, np.int32)
    label[:, :, 1, 1] = 1
    label[3:, :, 2, 4] = 2
    return log_odds, label


def small_trajectory() -> Rows:
    """Track 1 in every frame, track 2 in the last three."""
    frame, identity = np.array(sorted([(frame, 1) for frame in FRAMES] + [(frame, 2) for frame in FRAMES[3:]])).T
    return table_of(TRAJECTORY, frame=frame, id=identity, x=0.15 * identity, y=0.2, height=1.7, score=4.0, views=2)


def table_of(dtype: np.dtype[np.void], **columns: ArrayLike) -> Rows:
    """A table of columns, each one value or one for each row; the others are zero."""
    rows = np.zeros(np.broadcast_shapes((1,), *map(np.shape, columns.values())), dtype)
    for name, values in columns.items():
        rows[name] = values
    return rows


def trajectory_of(*rows: tuple[int, int, float, float]) -> Rows:
    """Rows of frame, id, x, y of people 1.7 m tall."""
    frame, identity, x, y = np.reshape(rows, (-1, 4)).T
    return table_of(TRAJECTORY, frame=frame, id=identity, x=x, y=y, height=1.7)


def small_ghosts() -> Rows:
    """Three candidates, one of them a ghost, of which the right view says nothing."""
    table = table_of(ghost_type(2), frame=(10, 10, 11), status=(1, 0, 1))
    table["parts"][:, 0] = (2.0, -1.0, 2.0)
    return table


def append_frames(writer: RunWriter, frames: Ints, log_odds: Singles, label: Labels) -> None:
    """Append volumes (time, plane, y, x)."""
    packed = [packed_volume(*volume) for volume in zip(log_odds, label, strict=True)]
    writer.append_packed_log_odds(frames, [one for one, _ in packed])
    writer.append_packed_labels([other for _, other in packed])


def fill(writer: RunWriter) -> None:
    """Everything but the end, in two windows of three frames."""
    log_odds, label = small_volume()
    for index, part in enumerate((slice(0, 3), slice(3, 6))):
        append_frames(writer, FRAMES[part], log_odds[part], label[part])
        bounds = (index, FRAMES[part][0], FRAMES[part][-1] + 1, FRAMES[part][0], FRAMES[part][-1] + 1)
        writer.append("windows", np.array([(*bounds, 12345, 1e-6, 7)], WINDOW))
        rates = [(FRAMES[part][-1], view, 0.2, 0.05 / (index + 1), 0.4, 0.25, 0.02) for view in range(2)]
        writer.append("rates", np.array(rates, RATES))
        writer.append("timings", np.array([(b"cut", index, 1.5), (b"volume", index, 0.5)], TIMING))
    writer.append("trajectory", small_trajectory())
    writer.append("boxes", np.array([(10, 1, 0, 1.0, 2.0, 3.0, 4.0)], BOX))
    writer.append("events", np.array([(10, b"birth", 1, 0, b"start"), (13, b"birth", 2, 0, b"entered")], EVENT))
    writer.append("ghosts", small_ghosts())


def write_run(
    path: Path, recording: Recording, trajectory: Rows, frames: Ints = FRAMES, config: str = CONFIG, views: int = 1
) -> Path:
    """A run file of these tracks and of cells that so many views see, without evidence of any."""
    shape = recording.rig.grid.shape
    with RunWriter(path, recording, np.full(shape, views, np.uint8), config, overwrite=True) as writer:
        volume = np.zeros((len(frames), *shape), np.float32)
        append_frames(writer, frames, volume, volume.astype(np.int32))
        writer.append("trajectory", trajectory)
        writer.finish(Tracks(trajectory).summary())
    return path


def write_empty_run(path: Path) -> Path:
    """A run file without frames."""
    return write_run(path, small_recording(path.parent), trajectory_of(), FRAMES[:0])


def write_small_run(path: Path, overwrite: bool = False, recording: Recording | None = None) -> Path:
    """A whole run file, of the small recording or another one of its size."""
    recording = recording or small_recording(path.parent)
    views = np.full(recording.rig.grid.shape, 2, np.uint8)
    with RunWriter(path, recording, views, CONFIG, overwrite=overwrite) as writer:
        fill(writer)
        writer.finish(Tracks(small_trajectory()).summary())
    return path
