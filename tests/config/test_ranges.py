"""Constants of the stages out of their ranges."""

from dataclasses import replace
from functools import reduce

import pytest

from stseg.config import Config
from stseg.errors import ConfigError

WRONG = """
    belief.particles=1 belief.iterations=0 belief.outlier_rate=1 belief.neutral_distance=0 belief.colour_weight=0
    belief.seed=-1
    foreground.chromatic.chromatic_sd=0
    foreground.codebook.codewords=0 foreground.codebook.brightest_highlight=1 foreground.codebook.recurrence=1
    foreground.codebook.absence=0 foreground.codebook.channel_sd=0 foreground.codebook.memory=0
    foreground.mixture.modes=0 foreground.mixture.smoothing_radius=-1 foreground.mixture.memory=0
    foreground.mixture.shadow_prior=1 foreground.mixture.background_weight=nan
    kalman.gate_probability=1 kalman.patience=-1
    labels.contrast_slope=0 labels.position_noise=0 labels.samples=0 labels.outlier_rate=1
    live.correction_interval=-1 live.correction_memory=0
    particles.particles=0 particles.velocity_spread=0 particles.seed=-1 particles.patience=-1
    proposals.unseen_rate=0 proposals.body_sizes=1 proposals.kernel_radius=0
    segmentation.neighbours=26 segmentation.smoothness=17
    segments.length=0 segments.background_period=0
    tracking.return_probability=0.3
"""


@pytest.mark.parametrize("wrong", WRONG.split())
def test_constants_out_of_range_are_named(wrong: str) -> None:
    place, value = wrong.split("=")
    *sections, key = place.split(".")
    config = reduce(getattr, sections, Config())
    with pytest.raises(ConfigError, match=key):
        replace(config, **{key: type(getattr(config, key))(value)})
