"""The background model that the configuration names."""

from __future__ import annotations

from stseg.config import ForegroundConfig
from stseg.foreground.background import Background
from stseg.foreground.chromatic import Chromatic
from stseg.foreground.codebook import Codebook
from stseg.foreground.mixture import Mixture

_AUTO = "mixture"


def make_background(size: tuple[int, int], frame_rate: float, config: ForegroundConfig) -> Background:
    """A background model that has learned nothing yet.

    Parameters
    ----------
    size
        Width and height of the images, pixels.
    frame_rate
        Frames per second at which its likelihood will be asked.
    config
        Names it, and holds the constants of each.
    """
    name = _AUTO if config.model == "auto" else config.model
    if name == "chromatic":
        return Chromatic(size, frame_rate, config.chromatic)
    if name == "codebook":
        return Codebook(size, frame_rate, config.codebook)
    return Mixture(size, frame_rate, config)
