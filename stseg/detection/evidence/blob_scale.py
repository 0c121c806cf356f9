"""Scale of blobs: how much of each view's foreground one body explains, pixel by pixel.

Errors of a segmentation are alike over a body, so its pixels count as few independent observations
(`effective_observations`), of which each is a share of the body's area. A small far body that stands in the image of a
near one would count as many on a fraction of the pixels, though most of the blob is left unexplained. So no pixel
weighs more than in the largest body that explains it: of all common bodies that the views together hold to be worth a
person, the one with the greatest sum of log-odds, counted in pixels that are certainly foreground.
"""

import numpy as np

from stseg.arrays import Floats, Ints, Singles
from stseg.config import BodyConfig, DetectionConfig
from stseg.detection.evidence.pillar_evidence import fill_scores, pillar_evidence
from stseg.detection.evidence.pixel_lattice import PixelLattice
from stseg.detection.evidence.unexplained_pixels import UnexplainedPixels, unsigned
from stseg.kernels.accelerate import kernel, part
from stseg.kernels.pointed_tuples import pointed


def blob_scales(
    rasters: Singles, extremes: Floats, lattice: PixelLattice, config: DetectionConfig, body: BodyConfig
) -> Singles:
    """Raster pixels of the largest body that explains each pixel, float32 (view, v, u); 0 where none does, on rasters.

    `rasters` float32 (view, v, u) are log-odds of the views that deliver pixels, zero where a view is blind, nats;
    `extremes` float64 (view, 2) the lowest and the highest of them; `lattice` holds the pillars of bodies.
    """
    scale, owner, middle = np.zeros(rasters.shape, np.float32), lattice.owner.reshape(-1), len(body.heights) // 2
    pixels = UnexplainedPixels.of(rasters, owner, lattice, extremes)
    score = np.full((len(body.heights), lattice.cells.box.shape[1]), config.prior_log_odds)
    fill_scores(pixels, lattice, np.array([middle]), np.zeros(0, np.int64), 0.0, config.effective_observations, score)
    certain = float(np.log((1 - config.pixel_miss_rate) / config.pixel_clutter_rate))
    _fill_scales(pixels, lattice, np.flatnonzero(score[middle] > 0), middle, len(score), certain, scale)
    return scale


@kernel
def _fill_scales(
    every_pixel: UnexplainedPixels,
    every_pillar: PixelLattice,
    cells: Ints,
    height: int,
    heights: int,
    certain: float,
    scale: Singles,
) -> None:
    """Raise scale (view, v, u), 0 before, inside the bodies of a height in some cells to what each explains."""
    pixels, lattice = pointed(every_pixel), pointed(every_pillar)
    for view in range(len(every_pillar.shapes)):
        for cell in cells:
            i = (view * heights + height) * every_pillar.cells.box.shape[1] + cell
            mean = pillar_evidence(view, cell, i, pixels, lattice, 1.0)
            _raise_inside(view, i, np.float32(lattice.outlines.area[i] * mean / certain), lattice, scale)


@part
def _raise_inside(view: int, i: int, value: np.float32, lattice: PixelLattice, scale: Singles) -> None:
    """Raise scale (view, v, u) to a value inside the i-th pillar of all."""
    at, row, spans = np.uint64(view), np.uint64(lattice.outlines.first[i]), lattice.outlines.spans
    for k in range(np.uint64(lattice.outlines.start[i]), np.uint64(lattice.outlines.start[i + 1])):
        for u in range(unsigned(spans[k, 0]), unsigned(spans[k, 1])):
            scale[at, row, u] = max(scale[at, row, u], value)
        row += np.uint64(1)
