"""What a session has learned for detection from the frames it explained."""

from __future__ import annotations

from dataclasses import dataclass

from stseg.detection.box_noise_calibration import BoxNoiseCalibration
from stseg.detection.population_calibration import PopulationCalibration
from stseg.detection.rim import RimCalibration
from stseg.detection.view_failures import ViewFailures


@dataclass(frozen=True)
class Calibrations:
    """Calibrations of one session; each frame that is explained updates them.

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

    box_noise: BoxNoiseCalibration
    population: PopulationCalibration
    rims: RimCalibration
    failures: ViewFailures
