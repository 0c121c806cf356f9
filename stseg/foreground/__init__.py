"""Pixels to likelihood maps: what one view says of each pixel, never thresholded (METHODS 2)."""

from stseg.config import ChromaticConfig, MixtureConfig
from stseg.foreground.background import Background
from stseg.foreground.boxes import box_likelihood
from stseg.foreground.chromatic import Chromatic
from stseg.foreground.instances import instance_boxes
from stseg.foreground.masks import mask_likelihood
from stseg.foreground.mixture import Mixture

__all__ = [
    "Background",
    "Chromatic",
    "ChromaticConfig",
    "Mixture",
    "MixtureConfig",
    "box_likelihood",
    "instance_boxes",
    "mask_likelihood",
]
