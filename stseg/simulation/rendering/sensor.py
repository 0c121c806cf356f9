"""Sensor model: lens blur, gain and noise."""

from __future__ import annotations

import cv2
import numpy as np

from stseg.arrays import Bytes, Singles

_SOFTNESS = 0.6
"""Standard deviation of the lens's blur, pixels."""


def expose(light: Bytes, gain: Singles | float, noise: float, rng: np.random.Generator) -> Bytes:
    """Expose a frame.

    Parameters
    ----------
    light : uint8 (v, u, 3)
        The scene at normal light.
    gain : float32 (v, u) or float
        Illumination relative to normal.
    noise
        Standard deviation of the sensor's noise, grey levels.
    rng
        Source of randomness.

    Returns
    -------
    uint8 (v, u, 3)
    """
    soft = cv2.GaussianBlur(light, (5, 5), _SOFTNESS)
    frame = rng.standard_normal(light.shape, np.float32)
    frame *= noise
    frame += np.float32(gain) * soft + 0.5 if isinstance(gain, float) else gain[..., None] * soft + np.float32(0.5)
    return np.clip(frame, 0, 255, out=frame).astype(np.uint8)
