"""Homographic occupancy without an explanation of the frame: the synergy map (Khan and Shah 2009, eqs 1 to 7).

localiser = Localiser(rig, "footprint")
volume = localiser.synergy(maps, localiser.clutter_weights(maps), least=0.05)
"""

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Bytes, Floats, Singles
from stseg.errors import SourceError
from stseg.geometry import Rig
from stseg.geometry.sampling import Footprints, Sampling, SamplingKind
from stseg.geometry.summed_area import TOP_LEVEL, UNSEEN, Levels, SumTable, sum_of
from stseg.geometry.summed_area import SummedArea as AreaSums
from stseg.kernels.accelerate import kernel
from stseg.occupancy.clutter import clutter, clutter_side, clutter_weights
from stseg.occupancy.fusion import ErrorRates, FrameTerms, Sums, log_odds_terms

Maps = Sequence[Singles | None]
"""The likelihood map float32 (v, u) of each view, 0..1, or None where it is blind."""


class Localiser:
    """Fusion of one rig's maps: tables are made once, frames are fused one by one.

    The reference plane may be any plane, not the ground alone.

    Parameters
    ----------
    rig
        The cameras and the grid.
    sampling
        "footprint": a cell is the mean over the pixels that it covers; "point": the pixel at its centre.
    """

    def __init__(self, rig: Rig, sampling: SamplingKind = "footprint") -> None:
        self.rig, self.sampling = rig, Sampling.of(rig, sampling)
        self._tables = [SumTable.over(region) for region in self.sampling.regions()]
        self._views = self.sampling.views()
        self._no_person = np.full(self._views.size, -1, np.int32)

    def clutter_weights(self, maps: Maps) -> Floats:
        """1 / C_i of each view, mean 1, 0 for blind views (Khan and Shah 2009, eqs 5, 6); float64 (view,)."""
        sides = [clutter_side(camera.size) for camera in self.rig.cameras]
        values = [np.nan if view is None else clutter(view, side) for view, side in zip(maps, sides, strict=True)]
        return clutter_weights(np.array(values))

    def views(self, maps: Maps) -> Bytes:
        """n_vis: how many of the views that are not blind see each cell, uint8 (plane, y, x)."""
        sighted = [view is not None for view in maps]
        return np.asarray((self.sampling.footprint[sighted][..., 2] > 0).sum(0), np.uint8)

    def synergy(self, maps: Maps, weights: Floats, least: float) -> Singles:
        """The synergy maps of all planes, nats (Khan and Shah 2009, eq. 7).

        Parameters
        ----------
        maps
            Likelihood map of each view.
        weights : float64 (view,)
            1 / C_i in any scale; all equal where clutter is not modelled.
        least
            Lower bound of the likelihoods, such as the miss rate: no view alone has a veto.

        Returns
        -------
        float32 (plane, y, x)
            nan where no view sees the cell.

        Raises
        ------
        SourceError
            Where a map is missing or of another size than its camera's image.
        """
        return self._fuse(maps, weights, np.stack([synergy_terms(least)] * len(maps)), 0.0)

    def log_odds(self, maps: Maps, weights: Floats, rates: Sequence[ErrorRates], occupied: float) -> Singles:
        """The calibrated log-odds u of all planes, nats (docs/how-it-works.md, Fusion).

        Parameters
        ----------
        maps, weights
            As in `synergy`.
        rates
            Error rates of each view.
        occupied
            pi, the share of cells that bodies fill.

        Returns
        -------
        float32 (plane, y, x)
            nan where no view sees the cell.

        Raises
        ------
        SourceError
            Where a map is missing or of another size than its camera's image.
        """
        prior = float(np.log(occupied / (1 - occupied)))
        return self._fuse(maps, weights, np.stack([log_odds_terms(rate) for rate in rates]), prior)

    def _fuse(self, maps: Maps, weights: Floats, terms: Singles, prior: float) -> Singles:
        self._require(maps)
        levels = [self._levels(i, view).reshape(-1) for i, view in enumerate(maps) if view is not None]
        sighted = [i for i, view in enumerate(maps) if view is not None]
        levels_of_views = np.array(levels, np.int16).reshape(len(sighted), -1)
        share, no_people = np.ones(levels_of_views.shape, np.float32), np.ones((len(sighted), 0), np.float32)
        weight = weights[sighted].astype(np.float32)
        sums = Sums.of(FrameTerms(levels_of_views, share, self._no_person, terms[sighted], weight, no_people))
        total = sums.total(self._no_person, 1.0, (prior, prior))
        total[self._views.reshape(-1) == 0] = np.nan
        return total.reshape(self._views.shape)

    def _levels(self, i: int, view: Singles) -> Levels:
        """Mean level of each cell in a view's map (v, u)."""
        table, levels = self._tables[i].filled(view), np.empty(self._views.shape, np.int16)
        fill_means(table.sums, self.sampling.footprint[i], table.left, table.top, levels)
        return levels

    def _require(self, maps: Maps) -> None:
        cameras = self.rig.cameras
        if len(maps) != len(cameras):
            raise SourceError("maps", "number", len(maps), f"{len(cameras)}, one a camera")
        for camera, view in zip(cameras, maps, strict=True):
            if view is not None and view.shape != camera.size[::-1]:
                raise SourceError(f"camera {camera.name}", "shape of the map", view.shape, f"{camera.size[::-1]}")


def synergy_terms(floor: float) -> Singles:
    """log max(L, floor) of each level, nats, float32 (2, TOP_LEVEL + 1): the same near people."""
    likelihood = np.arange(TOP_LEVEL + 1) / TOP_LEVEL
    return np.tile(np.log(np.maximum(likelihood, floor)).astype(np.float32), (2, 1))


@kernel
def fill_means(sums: AreaSums, footprint: Footprints, left: int, top: int, levels: Levels) -> None:
    """Fill levels (plane, y, x) with means over footprints (plane, y, x, 4), by sums from a column and row on."""
    boxes, flat = footprint.reshape(-1, 4), levels.reshape(-1)
    for c in range(len(boxes)):
        width, height = np.int32(boxes[c, 2]), np.int32(boxes[c, 3])
        if width == 0:
            flat[c] = UNSEEN
            continue
        u, v = boxes[c, 0] - left, boxes[c, 1] - top
        total = np.float32(sum_of(sums, u, v, u + width, v + height))
        flat[c] = np.int32(total / np.float32(width * height) + np.float32(0.5))
