"""Foreground likelihood of one view: soft maps, never thresholded (docs/how-it-works.md, Foreground)."""

from collections.abc import Callable
from typing import Any

from stseg.bodies.box_likelihood import box_likelihood as box_likelihood
from stseg.config import ForegroundConfig
from stseg.foreground.background.codebook import Codebook as Codebook
from stseg.foreground.background.mixture import Chromatic as Chromatic
from stseg.foreground.background.mixture import Mixture as Mixture
from stseg.foreground.background.model import Background as Background
from stseg.foreground.illumination import IlluminationMonitor as IlluminationMonitor
from stseg.foreground.illumination import LightChange as LightChange
from stseg.foreground.view_foreground import instance_boxes as instance_boxes
from stseg.foreground.view_foreground import mask_likelihood as mask_likelihood

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
