"""Background models by the names that the configuration gives them.

A further model is a module of this package, its constants in `stseg.config.foreground`, and one entry here.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from stseg.config import ForegroundConfig
from stseg.foreground.background.chromatic import Chromatic
from stseg.foreground.background.codebook import Codebook
from stseg.foreground.background.mixture import Mixture
from stseg.foreground.background.model import Background


class RegisteredModel(NamedTuple):
    """A background model.

    Attributes
    ----------
    make
        Called with the size of the images (width, height), the frame rate, and its constants.
    constants
        Finds these in the configuration.
    """

    make: Callable[[tuple[int, int], float, Any], Background]
    constants: Callable[[ForegroundConfig], Any]


MODELS = {
    "mixture": RegisteredModel(Mixture, lambda config: config.mixture),
    "chromatic": RegisteredModel(Chromatic, lambda config: config.chromatic),
    "codebook": RegisteredModel(Codebook, lambda config: config.codebook),
}
"""Every model that `foreground.model` may name."""


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
    model = MODELS[config.model]
    return model.make(size, frame_rate, model.constants(config))
