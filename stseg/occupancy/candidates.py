"""Candidates of a frame before anybody is explained: from the volume and from the detection probability (METHODS 6, 7).

The order is that of METHODS 7: whom earlier frames lead to expect come first, in the pass itself; then modes of the
volume that all evidence together makes, then modes of the detection probability. Who stands where another stands
already is a duplicate. Which of these sources a run asks is `detection.candidates`; docs/localisation.md says what each
is worth.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Boxes, Floats, Singles
from stseg.config import Config
from stseg.foreground import box_likelihood
from stseg.geometry import Grid, Rig
from stseg.ghosts.people import Explanation, People, ViewEvidence
from stseg.ghosts.pool import Pool
from stseg.ghosts.sizes import Sizes
from stseg.occupancy.modes import Modes, modes
from stseg.occupancy.probability import DetectionProbability
from stseg.occupancy.volume import Occupancy

_ROWS = 240
"""A map that boxes are drawn into has some so many rows."""
_FILLED = 0.3
"""Share of a column's planes that must be filled for it to be a sample: a person of whom two thirds are missed."""
_MOST = 30.0
"""A place speaks no louder than this, nats: what is so sure is one person, whatever the numbers."""


class Candidates:
    """Proposals for the pass of each frame.

    Parameters
    ----------
    occupancy
        The fusion of the rig's views.
    kinds
        What each camera delivers: "boxes" or "pixels".
    config
        Which sources are asked; how far apart candidates are that are not one; how tall and wide people are.
    """

    def __init__(self, occupancy: Occupancy, kinds: Sequence[str], config: Config) -> None:
        self.occupancy, self.config, self.ghosts = occupancy, config.detection, config.ghosts
        rig = occupancy.rig
        self.probability = None
        if self.config.candidates in ("probability", "both"):
            self.probability = DetectionProbability(rig, self.config, map_steps(rig, kinds))

    def of(self, seen: Sequence[ViewEvidence]) -> Pool | None:
        """Candidates of a frame, best first by source; None where none is asked for."""
        if self.config.candidates == "lattice":
            return None
        found = self._pool(np.zeros((0, 2)))
        if self.config.candidates in ("volume", "both"):
            volume = self.occupancy.fuse(seen, unexplained(self.occupancy, seen))
            rig = self.occupancy.rig
            found = found.and_apart(self._pool(volume_modes(volume, rig.grid, self.config.kernel).ground), self._apart)
        if self.probability is not None:
            own = probability_modes(self.probability, soft_maps(self.probability, seen))
            found = found.and_apart(self._pool(own.ground), self._apart)
        return found

    @property
    def _apart(self) -> float:
        return self.ghosts.lattice

    def _pool(self, ground: Floats) -> Pool:
        everywhere = np.ones(len(ground))
        return Pool(ground, self.ghosts.height_mean * everywhere, self.ghosts.width_mean * everywhere)


def map_steps(rig: Rig, kinds: Sequence[str]) -> list[int]:
    """Image pixels to a pixel of each view's map: 1 where it is delivered, more where boxes are drawn into it."""
    return [
        max(1, camera.size[1] // _ROWS) if kind == "boxes" else 1
        for camera, kind in zip(rig.cameras, kinds, strict=True)
    ]


def soft_maps(probability: DetectionProbability, seen: Sequence[ViewEvidence]) -> list[Singles | None]:
    """F_i of each view, boxes drawn as soft bodies."""
    cameras = probability.rig.cameras
    return [
        box_likelihood(view, camera.size, step) if isinstance(view, Boxes) else view
        for camera, step, view in zip(cameras, probability.steps, seen, strict=True)
    ]


def probability_modes(probability: DetectionProbability, maps: Sequence[Singles | None]) -> Modes:
    """Modes of the detection probability where the views together speak for somebody (HW12 eqs 7 to 9)."""
    said = probability.log_ratio(maps)
    return modes(weights(said), probability.ground, probability.spacing, probability.config.kernel)


def weights(said: Floats) -> Floats:
    """G of the samples, from its logarithm (y, x), nats: 0 where the views do not speak for anybody."""
    return np.where(said > 0, np.exp(np.minimum(said, _MOST)), 0.0)


def marginal(volume: Singles) -> Floats:
    """The volume's marginal on the ground: HW12's voxel histogram, each voxel counted by its log-odds.

    Parameters
    ----------
    volume : float32 (plane, y, x)
        Log-odds, nats; nan where no view sees the cell.

    Returns
    -------
    float64 (y, x)
        Mean of what speaks for a cell over the planes, nats; 0 where too few of them are filled.
    """
    above = np.nan_to_num(volume.astype(float), nan=0.0).clip(0.0)
    return np.asarray(np.where((above > 0).mean(0) >= _FILLED, above.mean(0), 0.0))


def volume_modes(volume: Singles, grid: Grid, kernel: float) -> Modes:
    """Modes of the marginal of a volume of log-odds (plane, y, x): HW12's data-driven candidates."""
    return modes(marginal(volume), grid.ground, grid.cell, kernel)


def unexplained(occupancy: Occupancy, seen: Sequence[ViewEvidence]) -> Explanation:
    """A frame of which nothing is explained: nobody is there, and nobody's are all pixels and boxes."""
    none, views = np.zeros(0), len(seen)
    people = People(
        np.zeros((0, 2)), none, none, np.zeros((0, 2, 2)), none, np.zeros((views, 0)), np.zeros((views, 0)), none,
        np.zeros(0, np.int64), Sizes(none, none, none, none),
    )  # fmt: skip
    # One raster pixel for the whole image: nobody's everywhere.
    steps = tuple(max(camera.size) for camera in occupancy.rig.cameras)
    owner = tuple(np.full((1, 1), -1, np.int16) for _ in steps)
    boxes = tuple(np.full(len(view) if isinstance(view, Boxes) else 0, -1, np.int64) for view in seen)
    return Explanation(people, people, owner, steps, boxes, np.full(len(steps), np.nan))
