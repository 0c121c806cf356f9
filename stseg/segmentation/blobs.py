"""Blobs: ground regions of each track in each frame."""

import numpy as np
from scipy.ndimage import label as connected

from stseg.arrays import Flags, Floats, Ints, Labels, Singles
from stseg.records.blobs import UNASSIGNED, Blobs
from stseg.segmentation.blob_kernels import fill_centroids, fill_ground_labels, fill_nearest
from stseg.segmentation.patches import EIGHT_NEIGHBOURS, GroundPatches


def find_blobs(
    label: Labels, log_odds: Singles, people_ground: Floats, people_track: Ints, reach: float, patches: GroundPatches
) -> Blobs:
    """Blobs of one frame.

    The cells of a track form one blob; unassigned cells one blob for each connected component on the ground. A ground
    cell below cells of several labels goes to the one with the most mass above it. A detection without cells is a blob
    of extent 0, since its existence is decided before the cut. Outside the area it is dropped.

    `label` int32 (plane, row, column) is the track of each cell of the patches, UNASSIGNED, or 0 for background;
    `log_odds` float32 (plane, row, column) those of a person, nats, nan where no view sees the cell. `people_ground`
    float64 (n, 2) are the detections of the frame, metres, and `people_track` int64 (n,) their tracks. `reach` is the
    largest distance of a body's cells from its place, metres: a blob holds the detection of its track if one of its
    cells is within half of it.
    """
    ground_label = np.zeros(label.shape[1:], np.int32)
    fill_ground_labels(label, log_odds, ground_label)
    unassigned_component, number = _in_ground_order(ground_label == UNASSIGNED, patches.place)
    tracks = np.unique(ground_label[ground_label > 0])
    cells = np.where(ground_label > 0, 1 + np.searchsorted(tracks, ground_label), 0).astype(np.int32)
    cells[unassigned_component > 0] = len(tracks) + unassigned_component[unassigned_component > 0]
    track = np.concatenate([tracks, np.full(number, UNASSIGNED)]).astype(np.int64)
    nearest = np.empty(len(people_ground))
    fill_nearest(ground_label, people_ground, people_track, patches.ground, nearest)
    person = np.full(len(track), -1, np.int64)
    holding = np.flatnonzero(nearest <= reach / 2)
    person[tracks.searchsorted(people_track[holding])] = holding
    extent = np.bincount(cells.ravel(), minlength=len(track) + 1)[1:] * patches.grid.cell**2
    centroid = np.zeros((len(track), 2))
    meet = fill_centroids(cells, track, label, log_odds, patches.ground, centroid)
    touches = _touches(cells, len(track)) if meet else np.zeros((0, 2), np.int64)
    alone = _in_volume(people_ground, log_odds, patches)
    alone[person[person >= 0]] = False
    without = np.flatnonzero(alone)
    return Blobs(
        patches.on_ground(cells),
        np.append(track, people_track[without]),
        np.append(person, without),
        np.concatenate([centroid, people_ground[without]]),
        np.append(extent, np.zeros(len(without))),
        touches,
    )


def _in_ground_order(occupied: Flags, place: Ints) -> tuple[Labels, int]:
    """Components of what is taken on a sheet (row, column), from 1 in the order of their first ground cells."""
    if not occupied.any():
        return np.zeros(occupied.shape, np.int32), 0
    found, number = connected(occupied, EIGHT_NEIGHBOURS)
    component: Labels = np.asarray(found, np.int32)
    if number < 2:
        return component, number
    first = np.full(number, np.iinfo(np.int64).max)
    np.minimum.at(first, component[occupied] - 1, place[occupied])
    rank = np.zeros(number + 1, np.int32)
    rank[1 + np.argsort(first)] = np.arange(1, number + 1)
    return rank[component], number


def _in_volume(ground: Floats, log_odds: Singles, patches: GroundPatches) -> Flags:
    """Places (n, 2) above which the volume has a cell that some view sees, bool (n,)."""
    grid = patches.grid
    _, rows, columns = grid.shape
    cell = np.rint(grid.cell_of(ground)).astype(np.int64)
    column, row = cell.clip(0, (columns - 1, rows - 1)).T
    inside = (ground >= (grid.x[0], grid.y[0])).all(1) & (ground <= (grid.x[1], grid.y[1])).all(1)
    place = patches.on_sheet_at[row * columns + column]
    visible = np.isfinite(log_odds.reshape(len(log_odds), -1)[:, place]).any(0)
    return np.asarray(inside & (place >= 0) & visible)


def _touches(cells: Labels, number: int) -> Ints:
    """Pairs of blobs, from 0, in one connected component of the ground, int64 (k, 2)."""
    occupied = cells > 0
    component = connected(occupied, EIGHT_NEIGHBOURS)[0][occupied]
    members = np.unique(component.astype(np.int64) * (number + 1) + cells[occupied])
    component, blob = np.divmod(members, number + 1)
    first, second = np.nonzero(np.triu(component[:, None] == component, 1))
    return np.asarray(np.unique(np.column_stack([blob[first], blob[second]]) - 1, axis=0), np.int64)
