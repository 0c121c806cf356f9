"""Scale of blobs: how much of each view's foreground one body explains, pixel by pixel.

Errors of a segmentation are alike over a body, so its pixels count as few independent observations
(`effective_observations`), of which each is a share of the body's area. A small far body that stands in the image of a
near one would count as many on a fraction of the pixels, though most of the blob is left unexplained. So no pixel
weighs more than in the largest body that explains it: of all common bodies that the views together hold to be worth a
person, the one with the greatest sum of log-odds, counted in pixels that are certainly foreground.
"""

from __future__ import annotations

import numpy as np

from stseg.arrays import Floats, Singles
from stseg.config import BodyConfig, DetectionConfig
from stseg.detection.evidence.pillar_evidence import add_pillar_evidence, fill_around
from stseg.detection.evidence.pixel_lattice import PixelLattice
from stseg.detection.evidence.unexplained_pixels import UnexplainedPixels
from stseg.kernels.accelerate import kernel
from stseg.kernels.pointed_tuples import pointed


def blob_scales(
    rasters: Singles, extremes: Floats, lattice: PixelLattice, config: DetectionConfig, body: BodyConfig
) -> Singles:
    """Raster pixels of the largest body that explains each pixel, float32 (view, v, u); 0 where none does, on rasters.

    `rasters` float32 (view, v, u) are log-odds of the views that deliver pixels, zero where a view is blind, nats;
    `extremes` float64 (view, 2) the lowest and the highest of them; `lattice` holds the pillars of bodies.
    """
    scale, owner = np.empty(rasters.shape, np.float32), lattice.owner.reshape(-1)
    certain = float(np.log((1 - config.pixel_miss_rate) / config.pixel_clutter_rate))
    _fill_scales(
        UnexplainedPixels.of(rasters, owner, lattice, extremes), lattice, len(body.heights),
        config.effective_observations, config.prior_log_odds, certain, scale,
    )  # fmt: skip
    return scale


@kernel
def _fill_scales(
    every_pixel: UnexplainedPixels,
    every_pillar: PixelLattice,
    heights: int,
    weight: float,
    prior: float,
    certain: float,
    scale: Singles,
) -> None:
    """Fill scale (view, v, u) inside common bodies that are worth a person with what each explains, 0 elsewhere."""
    pixels, lattice = pointed(every_pixel), pointed(every_pillar)
    views = len(every_pillar.shapes)
    for view in range(views):
        for row in range(every_pillar.shapes[view, 0]):
            line = scale[view, row, : every_pillar.shapes[view, 1]]
            for u in range(len(line)):
                line[u] = 0.0
    (more, parts), pillars = np.empty((2, views)), len(every_pillar.outlines.first) // max(views, 1)
    cells = pillars // heights
    for cell in range(cells):
        pillar = cell * heights + heights // 2
        fill_around(cell, pixels, lattice, more)
        if add_pillar_evidence(prior, 0.0, pillar, cell, pillars, pixels, lattice, weight, more, parts) > -np.inf:
            total = 0.0
            for view in range(views):
                total += parts[view] / weight
            for view in range(views if prior + weight * total > 0 else 0):
                _raise_inside(view, view * pillars + pillar, parts[view] / weight, certain, lattice, scale)


@kernel
def _raise_inside(view: int, i: int, mean: float, certain: float, lattice: PixelLattice, scale: Singles) -> None:
    """Raise scale (view, v, u) inside the i-th pillar of all to the pixels that it explains."""
    outlines = lattice.outlines
    value, row = np.float32(outlines.area[i] * mean / certain), outlines.first[i]
    for k in range(outlines.start[i], outlines.start[i + 1]):
        line = scale[view, row, outlines.spans[k, 0] : outlines.spans[k, 1]]
        for u in range(len(line)):
            line[u] = value if value > line[u] else line[u]
        row += 1
