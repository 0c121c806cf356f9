"""Foreground likelihood of one view: soft maps, never thresholded (docs/how-it-works.md, Foreground)."""

from stseg.config import ChromaticConfig, CodebookConfig, MixtureConfig
from stseg.foreground.background import Background
from stseg.foreground.chromatic import Chromatic
from stseg.foreground.codebook import Codebook
from stseg.foreground.illumination import IlluminationMonitor, LightChange
from stseg.foreground.instances import instance_boxes
from stseg.foreground.masks import mask_likelihood
from stseg.foreground.mixture import Mixture
from stseg.foreground.registry import make_background
from stseg.model.box_likelihood import box_likelihood

__all__ = [
    "Background",
    "Chromatic",
    "ChromaticConfig",
    "Codebook",
    "CodebookConfig",
    "IlluminationMonitor",
    "LightChange",
    "Mixture",
    "MixtureConfig",
    "box_likelihood",
    "instance_boxes",
    "make_background",
    "mask_likelihood",
]
