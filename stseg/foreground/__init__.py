"""Foreground likelihood of one view: soft maps, never thresholded (docs/how-it-works.md, Foreground)."""

from collections.abc import Callable
from typing import Any

from stseg.bodies.box_likelihood import box_likelihood
from stseg.config import ChromaticConfig, CodebookConfig, ForegroundConfig, MixtureConfig
from stseg.foreground.background.codebook import Codebook
from stseg.foreground.background.mixture import Chromatic, Mixture
from stseg.foreground.background.model import Background
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

MODELS: dict[str, Callable[[tuple[int, int], float, Any], Background]] = {
    "mixture": Mixture,
    "chromatic": Chromatic,
    "codebook": Codebook,
}
"""Every model that `foreground.model` may name; its constants have the same name in the configuration."""


def make_background(size: tuple[int, int], frame_rate: float, config: ForegroundConfig) -> Background:
    """An untrained background model.

    Parameters
    ----------
    size
        Width and height of the images, pixels.
    frame_rate
        Frames per second at which its likelihood will be computed.
    config
        Names the model, and holds the constants of each.
    """
    return MODELS[config.model](size, frame_rate, getattr(config, config.model))
