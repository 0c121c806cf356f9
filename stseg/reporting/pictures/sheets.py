"""Volumes of a run as small grey PNG sheets, as many frames as a budget of bytes allows.

A sheet holds the planes of one frame below one another, each with y up. Grey 0 is a cell that no view sees; 1 to 127
are log-odds from -limit to limit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from stseg.arrays import AnyArray, Bytes, Ints, Labels, Singles
from stseg.geometry import Grid
from stseg.reporting.pictures.slices import colour_limit

ReadFrame = Callable[[int], tuple[Singles, Labels]]
"""The volume of a frame: log_odds and label, both (plane, y, x)."""

_MAX_FRAMES = 400
_MAX_CELLS = 5e8  # read in all
_MAX_SIDE = 160  # cells along the longer side of the ground
_HALF_RANGE = 63  # grey levels on either side of no evidence


@dataclass(frozen=True)
class Sheets:
    """Thin slices of a run."""

    frames: Ints
    """int64 (n,): frames of the sheets."""
    shape: tuple[int, int, int]
    """(plane, y, x) of a sheet; several cells of a large ground are one, the greatest."""
    limit: float
    """Log-odds of the greatest grey, nats."""
    pngs: list[bytes]
    """A sheet for each frame."""


def thin_sheets(frames: Ints, grid: Grid, read_frame: ReadFrame, budget: int, wanted: Ints) -> Sheets:
    """Sheets of evenly spread frames.

    Parameters
    ----------
    frames : int64 (time,)
        The run's frames.
    grid
    read_frame
        Reads a frame's volume.
    budget
        Bytes of all sheets together; where they are more, every second frame is left out until they are not.
    wanted : int64 (n,)
        Frames to include beside the evenly spread ones.

    Returns
    -------
    Sheets
        Without frames where there are none.
    """
    most = int(np.clip(_MAX_CELLS // np.prod(grid.shape), 3, _MAX_FRAMES))
    chosen = spread(frames, most)
    probes = chosen[len(chosen) // 6 :: max(1, len(chosen) // 3)][:3]
    limit = max((colour_limit(read_frame(int(frame))[0]) for frame in probes), default=1.0)
    step = max(1, -(-max(grid.shape[1:]) // _MAX_SIDE))
    shape = (grid.planes, -(-grid.shape[1] // step), -(-grid.shape[2] // step))
    pngs = {int(frame): _sheet(read_frame(int(frame))[0], step, limit) for frame in np.union1d(chosen, wanted)}
    while len(chosen) > 1 and sum(len(pngs[int(frame)]) for frame in chosen) > budget:
        chosen = chosen[::2]
    sheet_frames = np.union1d(chosen, wanted)
    return Sheets(sheet_frames, shape, limit, [pngs[int(frame)] for frame in sheet_frames])


def spread(frames: Ints, most: int) -> Ints:
    """At most so many of the frames, evenly spread, the first and the last among them."""
    if len(frames) <= most:
        return frames
    return np.asarray(frames[np.rint(np.linspace(0, len(frames) - 1, most)).astype(int)])


def coarse(log_odds: AnyArray, step: int) -> AnyArray:
    """The greatest of `step` x `step` cells that any view sees, (plane, y, x); nan where none is seen."""
    planes, tall, wide = log_odds.shape
    padding = ((0, 0), (0, -tall % step), (0, -wide % step))
    padded = np.pad(np.asarray(log_odds, np.float32), padding, constant_values=np.nan)
    blocks = padded.reshape(planes, padded.shape[1] // step, step, -1, step)
    return np.asarray(np.fmax.reduce(np.fmax.reduce(blocks, axis=4), axis=2))


def _sheet(log_odds: AnyArray, step: int, limit: float) -> bytes:
    cells = coarse(log_odds, step)[:, ::-1]
    level = np.rint(np.clip(np.nan_to_num(cells) / limit, -1, 1) * _HALF_RANGE) + _HALF_RANGE + 1
    grey: Bytes = np.where(np.isnan(cells), 0, level).astype(np.uint8)
    _, data = cv2.imencode(".png", grey.reshape(-1, grey.shape[2]), [cv2.IMWRITE_PNG_COMPRESSION, 9])
    return bytes(np.asarray(data, np.uint8))
