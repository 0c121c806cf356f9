"""Evidence of one frame: observations of all views and the prior, and the detection problem of any candidates."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stseg.arrays import Floats, Singles
from stseg.bodies.views import BoxView, DetectorView, PixelView, ViewObservations
from stseg.detection.evidence.blob_scale import blob_scales
from stseg.detection.evidence.box_lattice import BoxLattice
from stseg.detection.evidence.candidate_evidence import ProjectedBodies, box_evidence, pixel_evidence, stacked_rasters
from stseg.detection.evidence.pixel_lattice import PixelLattice
from stseg.detection.prior import Prior
from stseg.detection.problem import DetectionProblem, ScoreParameters
from stseg.detection.score.neighbours import neighbours_of
from stseg.records.candidates import Candidates


@dataclass(frozen=True)
class FrameEvidence:
    """Constants of all rounds of a frame: views, their observations (None where blind), and the prior.

    `lattice` has the birth lattice's pillars in the views that deliver pixels.
    """

    views: Sequence[DetectorView]
    observations: ViewObservations
    prior: Prior
    parameters: ScoreParameters
    lattice: PixelLattice

    @cached_property
    def extremes(self) -> Floats:
        """The lowest and the highest log-odds of each view that delivers pixels, 0 where it is blind: (view, 2)."""
        pairs = zip(self.views, self.observations, strict=True)
        extremes = [o.extremes if o else (0.0, 0.0) for view, o in pairs if isinstance(view, PixelView)]
        return np.array(extremes).reshape(-1, 2)

    @cached_property
    def rasters(self) -> Singles:
        """`stacked_rasters` of the views' log-odds."""
        return stacked_rasters(self.views, [None if o is None else o.raster for o in self.observations])

    @cached_property
    def box_lattice(self) -> BoxLattice:
        """The birth lattice with the frame's boxes."""
        pairs = enumerate(zip(self.views, self.observations, strict=True))
        views = {k: (view, o) for k, (view, o) in pairs if isinstance(view, BoxView) and o is not None}
        prior = self.prior.log_height(np.asarray(self.prior.body.heights))
        return BoxLattice(views, np.repeat(prior, self.views[0].bodies.shape[1]))

    @cached_property
    def box_scores(self) -> dict[bytes, Floats]:
        """Scores of people's patches by their boxes, as `stseg.detection.search.refine` found them in this frame."""
        return {}

    @cached_property
    def scales(self) -> Singles:
        """Scales of their pixels (`stseg.detection.evidence.blob_scale`)."""
        return blob_scales(self.rasters, self.extremes, self.lattice, self.prior.config, self.prior.body)

    def under(self, prior: Prior) -> FrameEvidence:
        """The same frame under a prior of other tracks; what was found of its views without tracks is kept."""
        other = copy(self)
        object.__setattr__(other, "prior", prior)
        return other

    def problem(self, pool: Candidates, bodies: ProjectedBodies, base: DetectionProblem | None) -> DetectionProblem:
        """The candidates of a pool as the kernels read them; `base` is the problem of the first ones, if there is one.

        `bodies` are the same candidates in the views that deliver boxes.
        """
        has_pixels = any(isinstance(view, PixelView) for view in self.views)  # boxes show no widths
        more, prior = pool if base is None else pool.after(len(base.ground)), self.prior
        boxes = box_evidence(self.views, self.observations, bodies, None if base is None else base.boxes)
        pixels = pixel_evidence(self.views, self.rasters, self.scales, pool, None if base is None else base.pixels)
        size_prior = prior.log_size(more.height, more.width) if has_pixels else prior.log_height(more.height)
        birth_cost, track_gain = prior.birth_cost(more.ground), prior.track_log_ratio(more)
        breadth = np.maximum(more.width / self.parameters.common_width, 1.0) if has_pixels else np.ones(len(more))
        if base is not None:
            size_prior = np.concatenate([base.size_prior, size_prior])
            birth_cost = np.concatenate([base.birth_cost, birth_cost])
            track_gain = np.concatenate([base.track_gain, track_gain])
            breadth = np.concatenate([base.breadth, breadth])
        return DetectionProblem(
            boxes=boxes,
            pixels=pixels,
            size_prior=size_prior,
            birth_cost=birth_cost,
            track_gain=track_gain,
            ground=pool.ground,
            breadth=breadth,
            neighbours=neighbours_of(pool.ground, breadth, self.parameters),
            parameters=self.parameters,
            owner=self.lattice.owner,
        )
