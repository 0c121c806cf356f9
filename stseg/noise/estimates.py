"""Noise, sizes and failures that a session has learned for detection from the frames it explained."""

from dataclasses import dataclass

from stseg.noise.box_bias_estimate import BoxBiasEstimate
from stseg.noise.box_noise_estimate import BoxNoiseEstimate
from stseg.noise.population_estimate import PopulationEstimate
from stseg.noise.rim_estimate import RimEstimate
from stseg.view_health.view_failures import ViewFailures


@dataclass
class Estimates:
    """Estimates of one session; each frame that is explained updates them.

    Each is made of what it needs of these: the number of views; frames per second; `BodyConfig`, the first guess of the
    population; `ErrorRateConfig`, how fast is forgotten, and from which evidence on people count.
    """

    box_noise: BoxNoiseEstimate
    box_bias: BoxBiasEstimate
    """Noise of detectors' boxes with the rate of missing ones, and the mean error of their lower edges."""
    population: PopulationEstimate
    """Sizes of people."""
    rims: RimEstimate
    """Eaten edges of silhouettes."""
    failures: ViewFailures
    """Views that fail."""
    frames: int = 0
    """Frames that were explained so far."""
