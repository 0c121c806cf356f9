"""Noise, sizes and failures that a session has learned for detection from the frames it explained."""

from __future__ import annotations

from dataclasses import dataclass

from stseg.noise.box_noise_estimate import BoxNoiseEstimate
from stseg.noise.population_estimate import PopulationEstimate
from stseg.noise.rim_estimate import RimEstimate
from stseg.view_health.view_failures import ViewFailures


@dataclass(frozen=True)
class Estimates:
    """Estimates of one session; each frame that is explained updates them.

    Attributes
    ----------
    box_noise
        Noise of detectors' boxes.
    population
        Sizes of people.
    rims
        Eaten edges of silhouettes.
    failures
        Views that fail.
    """

    box_noise: BoxNoiseEstimate
    population: PopulationEstimate
    rims: RimEstimate
    failures: ViewFailures
