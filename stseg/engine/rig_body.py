"""The population prior of a run: the configuration's, and what the rig says of the bodies that it watches."""

from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from stseg.config import BodyConfig, Config, DetectionConfig
from stseg.errors import ConfigError
from stseg.io.recording.recording import Recording
from stseg.io.untrusted import limits

_DEFAULT = BodyConfig()
_TRIED = np.linspace(-2.0, 2.0, 7)
"""Heights to try of bodies that a rig describes, standard deviations from their mean."""


def with_body_of(recording: Recording, config: Config) -> Config:
    """The configuration under the recording's population; what was configured counts before what the rig says.

    Heights that the search tries are those around the rig's mean, and two bodies keep a distance that grows with its
    width, unless they are configured.

    Raises
    ------
    ConfigError
        Where the rig's mean and a configured spread, or the other way round, contradict each other.
    """
    given: dict[str, Any] = {
        name: size
        for name, size in asdict(recording.body).items()
        if size is not None and getattr(config.body, name) == getattr(_DEFAULT, name)
    }
    for size, mean, spread in (("height", "height_mean", "height_spread"), ("width", "width_mean", "width_spread")):
        if mean in given and spread not in given and getattr(config.body, spread) == getattr(_DEFAULT, spread):
            given[spread] = given[mean] * getattr(_DEFAULT, spread) / getattr(_DEFAULT, mean)
        chosen = {name: given.get(name, getattr(config.body, name)) for name in (mean, spread)}
        if chosen[mean] <= 2 * chosen[spread]:
            place = f"[body] of {recording.path}"
            raise ConfigError(place, f"{size}_mean", chosen[mean], f"more than twice the spread, {chosen[spread]}")
    if {"height_mean", "height_spread"} & given.keys() and config.body.heights == _DEFAULT.heights:
        mean, spread = (given.get(name, getattr(config.body, name)) for name in ("height_mean", "height_spread"))
        given["heights"] = tuple(float(h) for h in (mean + spread * _TRIED).round(3).clip(0.05, limits.BODY[1]))
    if not given:
        return config
    return replace(config, body=replace(config.body, **given), detection=_with_room_for(given, config.detection))


def _with_room_for(given: Mapping[str, Any], detection: DetectionConfig) -> DetectionConfig:
    """The detector's constants with a distance of two bodies that grows with their width, unless it is configured."""
    usual = DetectionConfig().minimum_distance
    if "width_mean" not in given or detection.minimum_distance != usual:
        return detection
    return replace(detection, minimum_distance=usual * given["width_mean"] / _DEFAULT.width_mean)
