"""Foreground likelihood of one view: soft maps, never thresholded (docs/how-it-works.md, Foreground)."""

from stseg.bodies.box_likelihood import box_likelihood
from stseg.config import ChromaticConfig, CodebookConfig, MixtureConfig
from stseg.foreground.background.chromatic import Chromatic
from stseg.foreground.background.codebook import Codebook
from stseg.foreground.background.mixture import Mixture
from stseg.foreground.background.model import Background
from stseg.foreground.background.registry import make_background
from stseg.foreground.illumination import IlluminationMonitor, LightChange
from stseg.foreground.view_foreground import instance_boxes, mask_likelihood

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
