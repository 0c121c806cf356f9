"""Data of the page's script as JSON: sheets, tracks and candidates of a run, thinned to stay small.

Volumes are small grey PNG sheets, as many frames as a budget of bytes allows. A sheet holds the planes of one frame
below one another, each with y up. Grey 0 is a cell that no view sees; 1 to 127 are log-odds from -limit to limit.
"""

import base64
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import cv2
import numpy as np

from stseg.arrays import AnyArray, Bytes, Ints, Labels, Rows, Singles, even_rows
from stseg.geometry import Grid, Rig
from stseg.records.ghost_reasons import REASONS, ghost_reasons
from stseg.reporting.page.html import script_json
from stseg.reporting.pictures.colours import hex_colour, track_colour
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
    chosen = frames[even_rows(len(frames), most)]
    probes = chosen[len(chosen) // 6 :: max(1, len(chosen) // 3)][:3]
    limit = max((colour_limit(read_frame(int(frame))[0]) for frame in probes), default=1.0)
    step = max(1, -(-max(grid.shape[1:]) // _MAX_SIDE))
    shape = (grid.planes, -(-grid.shape[1] // step), -(-grid.shape[2] // step))
    pngs = {int(frame): _sheet(read_frame(int(frame))[0], step, limit) for frame in np.union1d(chosen, wanted)}
    while len(chosen) > 1 and sum(len(pngs[int(frame)]) for frame in chosen) > budget:
        chosen = chosen[::2]
    sheet_frames = np.union1d(chosen, wanted)
    return Sheets(sheet_frames, shape, limit, [pngs[int(frame)] for frame in sheet_frames])


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
    _, data = cv2.imencode(".png", grey.reshape(-1, grey.shape[2]), [cv2.IMWRITE_PNG_COMPRESSION, 6])
    return bytes(np.asarray(data, np.uint8))


_MAX_PLACES = 250_000  # of tracks
_MAX_CANDIDATES = 120  # of a frame, those with most evidence


def embedded_json(
    rig: Rig, views: Bytes, trajectory: Rows, candidates: Rows, sheets: Sheets, names: Mapping[int, str]
) -> str:
    """The script's data; safe inside a script element.

    Parameters
    ----------
    views : uint8 (plane, y, x)
        Number of views that see each cell.
    trajectory : TRAJECTORY (n,)
    candidates : rows (n,) with frame, x, y, status, evidence, parts
    sheets
        Its frames are those of the slider.
    names
        Of tracks, by id.
    """
    grid = rig.grid
    coverage = np.where(grid.inside(), views.max(axis=0), np.uint8(len(rig.cameras)))[::-1]  # light beside the area
    data = {
        "frameRate": rig.frame_rate,
        "x": grid.x,
        "y": grid.y,
        "polygon": None if grid.polygon is None else np.asarray(grid.polygon, float).tolist(),
        "heights": np.round(grid.heights, 3).tolist(),
        "cameras": [camera.name for camera in rig.cameras],
        "stands": [[round(float(metres), 2) for metres in camera.centre[:2]] for camera in rig.cameras],
        "coverage": {"shape": coverage.shape, "views": _base64(np.ascontiguousarray(coverage))},
        "frames": sheets.frames.tolist(),
        "volume": {
            "shape": sheets.shape,
            "limit": round(sheets.limit, 3),
            "sheets": [base64.b64encode(png).decode("ascii") for png in sheets.pngs],
        },
        "tracks": _tracks(rig, trajectory, sheets.frames, names),
        "reasons": REASONS,
        "candidates": _candidates(candidates, sheets.frames),
        "ghosts": _ghost_counts(candidates, sheets.frames),
    }
    return script_json(data)


def thin_tracks(trajectory: Rows, slider_frames: Ints, most: int = _MAX_PLACES) -> tuple[Rows, int]:
    """Thin rows for the page, sorted by id and frame, and the stride in frames.

    The ends of every track, the slider's frames and every stride-th frame are kept.
    """
    table = trajectory[np.lexsort((trajectory["frame"], trajectory["id"]))]
    stride = max(1, -(-len(table) // most))
    first = np.concatenate([[True], table["id"][1:] != table["id"][:-1]])[: len(table)]
    last = np.roll(first, -1)
    kept = first | last | (table["frame"] % stride == 0) | np.isin(table["frame"], slider_frames)
    return table[kept], stride


def _tracks(rig: Rig, trajectory: Rows, slider_frames: Ints, names: Mapping[int, str]) -> dict[str, object]:
    table, stride = thin_tracks(trajectory, slider_frames)
    (x0, x1), (y0, y1) = rig.grid.x, rig.grid.y
    quantum = max(0.001, max(x1 - x0, y1 - y0) / 15000)  # metres; places a little outside the ground still fit 16 bits
    x, y = (np.clip(np.rint(table[name] / quantum), -32768, 32767) for name in ("x", "y"))
    identities, counts = np.unique(table["id"], return_counts=True)
    return {
        "quantum": quantum,
        "stride": stride,
        "ids": identities.tolist(),
        "names": [names.get(int(identity), "") for identity in identities],
        "counts": counts.tolist(),
        "colours": [hex_colour(track_colour(int(identity))) for identity in identities],
        "frame": _base64(table["frame"].astype("<i4")),
        "x": _base64((x - round(x0 / quantum)).astype("<i2")),
        "y": _base64((y - round(y0 / quantum)).astype("<i2")),
    }


def _candidates(candidates: Rows, slider_frames: Ints) -> list[list[list[object]]]:
    """Candidates of each slider frame by evidence: x, y, evidence, reason (-1 for a person) and evidence by view."""
    rows = candidates[np.isin(candidates["frame"], slider_frames)]
    found = ghost_reasons(rows)
    reason = np.full(len(rows), -1)
    reason[rows["status"] == 0] = found.reason
    order = np.lexsort((-rows["evidence"], rows["frame"]))
    rows, reason = rows[order], reason[order]
    bounds = np.searchsorted(rows["frame"], [*slider_frames.tolist(), np.iinfo(np.int64).max])
    listed = []
    for start, stop in zip(bounds[:-1].tolist(), bounds[1:].tolist(), strict=True):
        part = range(start, min(stop, start + _MAX_CANDIDATES))
        listed.append([_candidate(rows[k], int(reason[k])) for k in part])
    return listed


def _ghost_counts(candidates: Rows, slider_frames: Ints) -> list[int]:
    """Number of ghosts of each slider frame, including those that `_candidates` omits."""
    frames = np.sort(candidates["frame"][candidates["status"] == 0])
    counts = np.searchsorted(frames, slider_frames, "right") - np.searchsorted(frames, slider_frames)
    return [int(count) for count in counts]


def _candidate(row: np.void, reason: int) -> list[object]:
    parts = [round(float(part), 1) for part in np.nan_to_num(row["parts"])]
    return [round(float(row["x"]), 2), round(float(row["y"]), 2), round(float(row["evidence"]), 1), reason, parts]


def _base64(values: AnyArray) -> str:
    return base64.b64encode(values.tobytes()).decode("ascii")
