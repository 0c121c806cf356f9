"""Scale of blobs: how much of each view's foreground one body explains, pixel by pixel.

Errors of a segmentation are alike over a body, so its pixels count as few independent observations
(`effective_observations`), of which each is a share of the body's area. A small far body that stands in the image of a
near one would count as many on a fraction of the pixels, though most of the blob is left unexplained. So no pixel
weighs more than in the largest body that explains it: of all common bodies that the views together hold to be worth a
person, the one with the greatest sum of log-odds, counted in pixels that are certainly foreground.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.accelerate import kernel
from stseg.arrays import Floats, Ints, Singles
from stseg.config import DetectionConfig
from stseg.detection.views import BoxView, PixelView, ViewObservation
from stseg.model.packed_outlines import PackedOutlines


def blob_scales(
    views: Sequence[BoxView | PixelView], observations: Sequence[ViewObservation | None], config: DetectionConfig
) -> list[Singles]:
    """Raster pixels of the largest body that explains each pixel, float32 (v, u) a view; 0 where none does.

    Those of views with boxes are empty.
    """
    scales = [np.zeros(view.shape if isinstance(view, PixelView) else (0, 0), np.float32) for view in views]
    shown = [
        (view, scale, view.common_means(observation))
        for view, observation, scale in zip(views, observations, scales, strict=True)
        if isinstance(view, PixelView) and observation is not None
    ]
    if shown:
        evidence = config.effective_observations * np.sum([mean for _, _, mean in shown], axis=0)
        worth = np.flatnonzero(config.prior_log_odds + evidence > 0)
        certain = np.log((1 - config.pixel_miss_rate) / config.pixel_clutter_rate)
        for view, scale, mean in shown:
            pillars = view.common * len(mean) + worth
            _raise_inside(scale, view.lattice, pillars, view.lattice.area[pillars] * mean[worth] / certain)
    return scales


@kernel
def _raise_inside(scale: Singles, outlines: PackedOutlines, pillars: Ints, explained: Floats) -> None:
    """Raise scale (v, u) inside outlines to what each of some pillars (n,) explains (n,)."""
    for n in range(len(pillars)):
        i, value = pillars[n], np.float32(explained[n])
        row = outlines.first[i]
        for k in range(outlines.start[i], outlines.start[i + 1]):
            line = scale[row, outlines.spans[k, 0] : outlines.spans[k, 1]]
            for u in range(len(line)):
                line[u] = value if value > line[u] else line[u]
            row += 1
