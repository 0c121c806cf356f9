"""Candidates of a frame from the volume and from the detection probability (Huang and Wang 2012, eqs 7 to 9).

Predicted tracks come first, in the detector itself; then modes of the volume of all evidence, then modes of the
detection probability (HW12 section III). A proposal at the place of an earlier one is a duplicate. The sources are
chosen by `proposals.source`.
"""

from collections.abc import Callable, Sequence

import numpy as np

from stseg.arrays import Boxes, Floats, Singles, ViewEvidence
from stseg.baselines.huang_wang_2012.detection_probability import DetectionProbability
from stseg.baselines.huang_wang_2012.mean_shift import Modes, modes
from stseg.bodies.box_likelihood import box_likelihood
from stseg.config import Config
from stseg.geometry import Grid, Rig
from stseg.records.candidates import Candidates
from stseg.records.people import Explanation, People
from stseg.records.sizes import Sizes

Fuse = Callable[[Sequence[ViewEvidence], Explanation], Singles]

_ROWS = 240
"""Rows of a map that boxes are drawn into, about."""
_FILLED = 0.3
"""Share of a column's planes that must be filled for it to be a sample: a person of whom two thirds are missed."""
_LOG_RATIO_LIMIT = 30.0
"""Largest log-ratio of a sample, nats: beyond it a place is certain, and larger weights only drown its neighbours."""


class Proposals:
    """Proposals for the detector.

    Parameters
    ----------
    rig
        The cameras and the grid.
    kinds
        What each camera delivers: "boxes" or "pixels".
    config
        Sources, least distance of two candidates, sizes of people.
    """

    def __init__(self, rig: Rig, kinds: Sequence[str], config: Config) -> None:
        self.rig, self.config, self.detection = rig, config.proposals, config.detection
        self.body = config.body
        self.probability = None
        if self.config.source in ("probability", "both"):
            self.probability = DetectionProbability(rig, self.config, config.body, map_steps(rig, kinds))

    def of(self, evidence: Sequence[ViewEvidence], fuse: Fuse) -> Candidates:
        """Candidates of a frame, best first by source.

        Parameters
        ----------
        evidence
            Evidence of each view.
        fuse
            The volume float32 (plane, y, x) of a frame's evidence under an explanation, nats (`stseg.occupancy`).
        """
        found = self._pool(np.zeros((0, 2)))
        if self.config.source in ("volume", "both"):
            volume = fuse(evidence, empty_explanation(self.rig, evidence))
            found = found.joined_if_distant(
                self._pool(volume_modes(volume, self.rig.grid, self.config.kernel_radius).ground), self._apart
            )
        if self.probability is not None:
            modes = probability_modes(self.probability, soft_maps(self.probability, evidence))
            found = found.joined_if_distant(self._pool(modes.ground), self._apart)
        return found

    @property
    def _apart(self) -> float:
        return self.detection.lattice_spacing

    def _pool(self, ground: Floats) -> Candidates:
        everywhere = np.ones(len(ground))
        return Candidates(ground, self.body.height_mean * everywhere, self.body.width_mean * everywhere)


def map_steps(rig: Rig, kinds: Sequence[str]) -> list[int]:
    """Image pixels to a pixel of each view's map: 1 where it is delivered, more where boxes are drawn into it."""
    return [
        max(1, camera.size[1] // _ROWS) if kind == "boxes" else 1
        for camera, kind in zip(rig.cameras, kinds, strict=True)
    ]


def soft_maps(probability: DetectionProbability, evidence: Sequence[ViewEvidence]) -> list[Singles | None]:
    """F_i of each view, boxes drawn as soft bodies."""
    cameras = probability.rig.cameras
    return [
        box_likelihood(view, camera.size, step) if isinstance(view, Boxes) else view
        for camera, step, view in zip(cameras, probability.steps, evidence, strict=True)
    ]


def probability_modes(probability: DetectionProbability, maps: Sequence[Singles | None]) -> Modes:
    """Modes of the detection probability where its log-ratio is above 0 (HW12 eqs 7 to 9)."""
    log_ratio = probability.log_ratio(maps)
    return modes(sample_weights(log_ratio), probability.ground, probability.spacing, probability.config.kernel_radius)


def sample_weights(log_ratio: Floats) -> Floats:
    """G of the samples, from its logarithm (y, x), nats: 0 where that is not above 0."""
    return np.where(log_ratio > 0, np.exp(np.minimum(log_ratio, _LOG_RATIO_LIMIT)), 0.0)


def marginal(volume: Singles) -> Floats:
    """The volume's marginal on the ground: HW12's voxel histogram, each voxel counted by its log-odds.

    Parameters
    ----------
    volume : float32 (plane, y, x)
        Log-odds, nats; nan where no view sees the cell.

    Returns
    -------
    float64 (y, x)
        Mean over the planes of the evidence for a cell, nats; 0 where too few of them are filled.
    """
    above = np.nan_to_num(volume.astype(float), nan=0.0).clip(0.0)
    return np.asarray(np.where((above > 0).mean(0) >= _FILLED, above.mean(0), 0.0))


def volume_modes(volume: Singles, grid: Grid, kernel: float) -> Modes:
    """Modes of the marginal of a volume of log-odds (plane, y, x): HW12's data-driven candidates."""
    return modes(marginal(volume), grid.ground, grid.cell, kernel)


def empty_explanation(rig: Rig, evidence: Sequence[ViewEvidence]) -> Explanation:
    """The explanation of a frame without people: every pixel and every box is unassigned."""
    none, views = np.zeros(0), len(evidence)
    people = People(
        np.zeros((0, 2)),
        none,
        none,
        np.zeros((0, 2, 2)),
        none,
        np.zeros((views, 0)),
        np.zeros((views, 0)),
        none,
        np.zeros(0, np.int64),
        Sizes(none, none, none, none),
    )
    # One raster pixel for the whole image, unassigned.
    steps = tuple(max(camera.size) for camera in rig.cameras)
    owner = tuple(np.full((1, 1), -1, np.int16) for _ in steps)
    boxes = tuple(np.full(len(view) if isinstance(view, Boxes) else 0, -1, np.int64) for view in evidence)
    return Explanation(people, people, owner, steps, boxes, np.full(len(steps), np.nan))
