"""Pictures of one frame's occupancy volume: all planes, one plane, and the maximum over the planes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter

from stseg.arrays import AnyArray, Bytes, Flags, Labels
from stseg.geometry import Grid
from stseg.reporting.pictures.canvas import blank, chip, outline, text
from stseg.reporting.pictures.colours import INK, PAPER, QUIET, RULE, Picture, track_colour

_STOPS = np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
# blue-ish below 0, nearly white at 0, orange above; blue, green, red
_TONES = np.array([(176, 128, 84), (230, 204, 176), (249, 249, 249), (110, 184, 253), (34, 104, 222)], float)
_UNSEEN = np.array([(236, 234, 232), (205, 201, 198)], np.uint8)  # hatching, light and dark
_GAP, _HEAD, _MARGIN, _FOOT = 22, 30, 26, 64  # pixels
_SHEET_SHAPE = 1.6  # width over height
_SHEET_WIDTH = 1400  # of a contact sheet, about, pixels
_MAX_OUTLINE = 5  # greatest width of an outline, pixels


def volume_picture(
    log_odds: AnyArray, label: Labels, grid: Grid, title: str = "", limit: float | None = None
) -> Picture:
    """All planes of one frame as a contact sheet, the ground first, y up.

    `log_odds` float (plane, y, x) are nats, nan where no view sees the cell; the ids of `label` int32 (plane, y, x) are
    outlined, 0 is background. Colours end at log-odds of `limit`, nats, or at the 99th percentile of their sizes.
    """
    panels = [_Panel(f"{z:.2f} m", log_odds[k], label[k]) for k, z in enumerate(grid.heights)]
    return _contact_sheet(panels, title, _SHEET_WIDTH, colour_limit(log_odds) if limit is None else limit)


def marginal_picture(
    log_odds: AnyArray, label: Labels, grid: Grid, title: str = "", width: int = 700, limit: float | None = None
) -> Picture:
    """The greatest log-odds over each ground cell, outlined by the id commonest above it; see `volume_picture`."""
    finite = np.isfinite(log_odds)
    highest = np.where(finite, log_odds, -np.inf).max(axis=0)
    highest = np.where(finite.any(axis=0), highest, np.nan)
    panel = _Panel(f"greatest of {grid.planes} planes; {_extent(grid)}", highest, _commonest(label))
    return _contact_sheet([panel], title, width, colour_limit(log_odds) if limit is None else limit)


def plane_picture(
    log_odds: AnyArray, label: Labels, grid: Grid, plane: int, title: str = "", width: int = 700
) -> Picture:
    """One plane of one frame, coloured as `volume_picture` colours it; `plane` counts from the ground, 0."""
    panel = _Panel(f"{grid.heights[plane]:.2f} m high; {_extent(grid)}", log_odds[plane], label[plane])
    return _contact_sheet([panel], title, width, colour_limit(log_odds))


@dataclass(frozen=True)
class _Panel:
    caption: str
    log_odds: AnyArray
    label: Labels


def colours_of(log_odds: AnyArray, limit: float) -> Bytes:
    """The diverging colour map, uint8 (..., 3); what is nan becomes 0's colour."""
    share = np.clip(np.nan_to_num(np.asarray(log_odds, float), posinf=limit, neginf=-limit) / limit, -1, 1)
    return np.asarray(np.rint(np.stack([np.interp(share, _STOPS, tone) for tone in _TONES.T], -1)), np.uint8)


def _contact_sheet(panels: Sequence[_Panel], title: str, width: int, limit: float) -> Bytes:
    rows, columns, scale = _arrange(len(panels), panels[0].label.shape, width)
    tall, wide = (side * scale for side in panels[0].label.shape)
    top = _MARGIN + (38 if title else 0)
    canvas_width = max(2 * _MARGIN + columns * (wide + _GAP) - _GAP, 560)
    canvas = blank(canvas_width, top + rows * (tall + _HEAD + _GAP) - _GAP + _FOOT + _MARGIN, PAPER)
    text(canvas, title, (_MARGIN, _MARGIN), INK, 18, (0, 0), 2)
    for k, panel in enumerate(panels):
        u = _MARGIN + (k % columns) * (wide + _GAP)
        v = top + (k // columns) * (tall + _HEAD + _GAP) + _HEAD
        text(canvas, panel.caption, (u, v - 9), QUIET, 15)
        corners = np.array([[u - 1, v - 1], [u + wide, v - 1], [u + wide, v + tall], [u - 1, v + tall]])
        outline(canvas, corners, RULE)
        canvas[v : v + tall, u : u + wide] = _panel_picture(panel, scale, limit)
        if len(panels) == 1:
            _name_tracks(canvas, panel.label, (u, v), scale)
    _colour_bar(canvas, limit)
    return canvas


def _extent(grid: Grid) -> str:
    """Ground of a panel, from left to right and from bottom to top."""
    (left, right), (bottom, top) = grid.x, grid.y
    return f"x {left:g} to {right:g} m, y {bottom:g} to {top:g} m upwards"


def _name_tracks(canvas: Bytes, label: Labels, corner: tuple[int, int], scale: int) -> None:
    """The id of each track above its cells."""
    for identity in np.unique(label[label > 0]).tolist():
        rows, columns = np.nonzero(label[::-1] == identity)
        place = (
            corner[0] + (columns.mean() + 0.5) * scale,
            max(corner[1] + rows.min() * scale - 14.0, corner[1] + 12.0),
        )
        chip(canvas, str(identity), place, track_colour(identity), 14)


def _arrange(count: int, shape: tuple[int, ...], width: int) -> tuple[int, int, int]:
    """Rows, columns and pixels a cell: few empty places, and a sheet of about `_SHEET_SHAPE`."""
    tall, wide = shape

    def waste(columns: int) -> float:
        rows = -(-count // columns)
        odd_shape = abs(np.log(columns * wide / (rows * tall) / _SHEET_SHAPE))
        return 1 - count / (rows * columns) + 0.5 * float(odd_shape)

    columns = min(range(1, count + 1), key=waste)
    rows = -(-count // columns)
    space = (width - 2 * _MARGIN - (columns - 1) * _GAP) / columns
    return rows, columns, max(1, int(space / wide))


def _panel_picture(panel: _Panel, scale: int, limit: float) -> Bytes:
    """A plane, y up, `scale` pixels a cell."""
    cell = np.repeat(np.repeat(panel.log_odds[::-1], scale, 0), scale, 1)
    label = np.repeat(np.repeat(panel.label[::-1], scale, 0), scale, 1)
    picture = colours_of(cell, limit)
    v, u = np.ogrid[: cell.shape[0], : cell.shape[1]]
    unseen = np.isnan(cell)
    picture[unseen] = _UNSEEN[((u + v) % 8 < 2).astype(int)][unseen]
    wide = min(max(1, scale // 5), _MAX_OUTLINE)
    rim = _rim(label, wide)
    picture[_rim(label, wide + 1) & ~rim] = PAPER
    for identity in np.unique(label[rim]).tolist():
        picture[rim & (label == identity)] = track_colour(identity)
    return picture


def _rim(label: AnyArray, width: int) -> Flags:
    """Pixels of a label within `width` of another one or of the edge, bool (v, u)."""
    least = minimum_filter(label, 2 * width + 1, mode="constant")
    greatest = maximum_filter(label, 2 * width + 1, mode="constant")
    return np.asarray((label > 0) & (least != greatest))


def _commonest(label: Labels) -> Labels:
    """The id that most planes give to each ground cell, 0 where none does; of equals the least, int32 (y, x)."""
    best, votes = np.zeros(label.shape[1:], np.int32), np.zeros(label.shape[1:], np.int64)
    for identity in np.unique(label[label > 0]).tolist():
        count = (label == identity).sum(axis=0)
        best[count > votes] = identity
        votes = np.maximum(votes, count)
    return best


def colour_limit(log_odds: AnyArray) -> float:
    """Default end of the colour scale: 99th percentile of the absolute log-odds, nats."""
    sizes = np.abs(np.asarray(log_odds, np.float32)[np.isfinite(log_odds)])
    return max(float(np.percentile(sizes, 99)), 1e-3) if sizes.size else 1.0


def _colour_bar(canvas: Bytes, limit: float) -> None:
    """Colour bar of the log-odds."""
    length, tall = 220, 14
    u, v = _MARGIN, canvas.shape[0] - _MARGIN - tall - 18
    ramp = np.linspace(-limit, limit, length)
    canvas[v : v + tall, u : u + length] = colours_of(ramp, limit)[None]
    for share, value in ((0.0, -limit), (0.5, 0.0), (1.0, limit)):
        text(canvas, f"{value:.2g}", (u + share * length, v + tall + 7), QUIET, 13, (share, 0))
    text(canvas, "log-odds, nats", (u + length + 16, v + tall / 2), QUIET, 13, (0, 0.5))
    hatch_u = u + length + 16 + 150
    rows, columns = np.ogrid[:tall, : 2 * tall]
    canvas[v : v + tall, hatch_u : hatch_u + 2 * tall] = _UNSEEN[((rows + columns) % 8 < 2).astype(int)]
    text(canvas, "no view", (hatch_u + 2 * tall + 8, v + tall / 2), QUIET, 13, (0, 0.5))
