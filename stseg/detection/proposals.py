"""Candidates of a frame before anybody is explained: from the volume and from the detection probability (METHODS 6, 7).

The order is that of METHODS 7: whom earlier frames lead to expect come first, in the pass itself; then modes of the
volume that all evidence together makes, then modes of the detection probability. Who stands where another stands
already is a duplicate. Which of these sources a run asks is `proposals.source`; docs/localisation.md says what each
is worth.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from stseg.arrays import Boxes, Floats, Singles, ViewEvidence
from stseg.config import Config
from stseg.detection.detection_probability import DetectionProbability
from stseg.detection.mean_shift import Modes, modes
from stseg.geometry import Grid, Rig
from stseg.model.box_likelihood import box_likelihood
from stseg.model.candidates import Candidates
from stseg.model.people import Explanation, empty_explanation

Fuse = Callable[[Sequence[ViewEvidence], Explanation], Singles]

_ROWS = 240
"""A map that boxes are drawn into has some so many rows."""
_FILLED = 0.3
"""Share of a column's planes that must be filled for it to be a sample: a person of whom two thirds are missed."""
_MOST = 30.0
"""A place speaks no louder than this, nats: what is so sure is one person, whatever the numbers."""


class Proposals:
    """Proposals for the pass of each frame.

    Parameters
    ----------
    rig
        The cameras and the grid.
    kinds
        What each camera delivers: "boxes" or "pixels".
    config
        Which sources are asked; how far apart candidates are that are not one; how tall and wide people are.
    """

    def __init__(self, rig: Rig, kinds: Sequence[str], config: Config) -> None:
        self.rig, self.config, self.ghosts = rig, config.proposals, config.detection
        self.body = config.body
        self.probability = None
        if self.config.source in ("probability", "both"):
            self.probability = DetectionProbability(rig, self.config, config.body, map_steps(rig, kinds))

    def of(self, seen: Sequence[ViewEvidence], fuse: Fuse) -> Candidates | None:
        """Candidates of a frame, best first by source; None where none is asked for.

        Parameters
        ----------
        seen
            Evidence of each view.
        fuse
            The volume float32 (plane, y, x) of a frame's evidence under an explanation, nats (`stseg.occupancy`).
        """
        if self.config.source == "lattice":
            return None
        found = self._pool(np.zeros((0, 2)))
        if self.config.source in ("volume", "both"):
            volume = fuse(seen, empty_explanation(self.rig, seen))
            found = found.joined_apart(
                self._pool(volume_modes(volume, self.rig.grid, self.config.kernel_radius).ground), self._apart
            )
        if self.probability is not None:
            own = probability_modes(self.probability, soft_maps(self.probability, seen))
            found = found.joined_apart(self._pool(own.ground), self._apart)
        return found

    @property
    def _apart(self) -> float:
        return self.ghosts.lattice_spacing

    def _pool(self, ground: Floats) -> Candidates:
        everywhere = np.ones(len(ground))
        return Candidates(ground, self.body.height_mean * everywhere, self.body.width_mean * everywhere)


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
    return modes(weights(said), probability.ground, probability.spacing, probability.config.kernel_radius)


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
