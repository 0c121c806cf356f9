"""Track labels of the occupied cells of a window.

A connected component of the minimum cut with one detected track gets that track's label. A component with several, in
whatever frames, is divided by expansion moves over the background, the tracks predicted in the window, and UNASSIGNED.
Cells that the binary cut leaves empty stay empty, exactly: no label of a cell gains more than u, and the smallest
source set of the greater gains contains those of smaller ones. So only the components need be expanded.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stseg.arrays import Flags, Floats, Ints, Labels
from stseg.graphcut.cell_subset import CellSubset, subset
from stseg.graphcut.expansion import expand
from stseg.graphcut.grid_energy import GridEnergy
from stseg.graphcut.solvers import Solver
from stseg.records.blobs import UNASSIGNED
from stseg.records.predicted_tracks import PredictedPlaces
from stseg.segmentation.label_energy import BodyShape, label_energy, track_shares
from stseg.segmentation.patches import GroundPatches


@dataclass(frozen=True)
class WindowDetections:
    """Per-frame detections of a window."""

    ground: Sequence[Floats]
    """float64 (n, 2) for each frame: metres."""
    track: Sequence[Ints]
    """int64 (n,) for each frame: track of each detection."""


def label_cells(
    energy: GridEnergy,
    occupied: Flags,
    detections: WindowDetections,
    predicted: PredictedPlaces,
    body: BodyShape,
    patches: GroundPatches,
    solver: Solver,
) -> Labels:
    """Track of every cell, UNASSIGNED without one, 0 outside the minimum cut, int32 (time, plane, y, x).

    `occupied` bool (time, plane, y, x) is the cut. `detections` are those of the window's frames; their tracks are all
    among those of `predicted`, the places of tracks in these frames. `body` is the extent of a body, `patches` hold the
    cells, and `solver` is that of the expansion moves, by which cells are divided where tracks touch.
    """
    subgraph = subset(energy, occupied)
    label = np.zeros(occupied.shape, np.int32)
    if not len(subgraph.cell):
        return label
    component = subgraph.components()
    occupied_by, displaced = _occupants(subgraph, component, occupied, detections, predicted, body.reach, patches)
    count = occupied_by.sum(1)
    track_ids = np.append(predicted.track, UNASSIGNED)
    labels = track_ids[np.where(count == 1, np.argmax(np.column_stack([occupied_by, count != 1]), 1), -1)][component]
    touching = count[component] > 1
    if touching.any():
        present = replace(predicted, expected=predicted.expected & ~displaced)
        labels[touching] = _expanded(energy, subgraph.only(touching), present, body, patches, solver)
    label.flat[subgraph.cell] = labels
    return label


def _expanded(
    energy: GridEnergy,
    subgraph: CellSubset,
    predicted: PredictedPlaces,
    body: BodyShape,
    patches: GroundPatches,
    solver: Solver,
) -> Ints:
    """Track of each cell of a subgraph, UNASSIGNED or 0, by expansion moves, int64 (n,)."""
    frame, plane, y, x = np.unravel_index(subgraph.cell, energy.unary.shape)
    share = track_shares(frame, patches.ground[y, x], patches.grid.heights[plane], predicted, body)
    problem = label_energy(energy.unary.ravel()[subgraph.cell], share, subgraph)
    track_ids = np.concatenate([[0], predicted.track, [UNASSIGNED]])
    return np.asarray(track_ids[expand(problem, problem.cheapest_labels(), solver.sparse)])


def _occupants(
    subgraph: CellSubset,
    component: Ints,
    occupied: Flags,
    detections: WindowDetections,
    predicted: PredictedPlaces,
    reach: float,
    patches: GroundPatches,
) -> tuple[Flags, Flags]:
    """Tracks detected in each component, bool (component, k), and outside all components in a frame, bool (time, k).

    A detection is in the components above the nearest occupied ground cell within half a reach.
    """
    occupied_by = np.zeros((int(component.max()) + 1, len(predicted.track)), bool)
    displaced = np.zeros_like(predicted.expected)
    for t, (ground, track) in enumerate(zip(detections.ground, detections.track, strict=True)):
        rows, columns = np.nonzero(occupied[t].any(0))
        cells_ground = patches.ground[rows, columns]
        for detection_ground, k in zip(ground, np.searchsorted(predicted.track, track), strict=True):
            distance = np.hypot(*(cells_ground - detection_ground).T)
            if distance.min(initial=np.inf) > reach / 2:
                displaced[t, k] = True
                continue
            row, column = rows[distance.argmin()], columns[distance.argmin()]
            planes = np.flatnonzero(occupied[t, :, row, column])
            above = np.ravel_multi_index((t, planes, row, column), occupied.shape)
            occupied_by[component[np.searchsorted(subgraph.cell, above)], k] = True
    return occupied_by, displaced
