"""From the observation of a camera to the evidence of its view: a likelihood map, or boxes."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import find_objects

from stseg.arrays import Boxes, Bytes, Observation, Singles, ViewEvidence
from stseg.errors import SourceError
from stseg.foreground.illumination import IlluminationMonitor
from stseg.kernels.accelerate import wide_kernel

_LIKELIHOOD_OF_GREY = np.arange(256, dtype=np.float32) / np.float32(255)


class ViewForeground:
    """Foreground stage of one camera.

    Parameters
    ----------
    background
        Background model of a colour camera; None for cameras that deliver masks, instances or boxes.
    """

    def __init__(self, background: IlluminationMonitor | None = None) -> None:
        self.background = background

    def evidence(self, observation: Observation) -> ViewEvidence:
        """Evidence of a frame; colour frames also update the background model."""
        if observation is None and self.background is not None:
            self.background.skip()
        if observation is None or isinstance(observation, Boxes):
            return observation
        if observation.dtype == np.uint16:
            return instance_boxes(np.asarray(observation, np.uint16))
        if observation.dtype == np.float32:
            return np.asarray(observation, np.float32)
        if observation.ndim == 2:
            return mask_likelihood(np.asarray(observation, np.uint8))
        if self.background is None:
            raise ValueError("a colour frame needs a background model")
        posterior = self.background.likelihood(np.asarray(observation, np.uint8))
        return None if posterior is None else without_prior(posterior, self.background.model.prior)

    def pixels(self, observation: Observation) -> Singles | None:
        """Foreground likelihood of each pixel, float32 (v, u); None where the view is blind or delivers boxes.

        As `evidence`, except that the pixels of an instance image have likelihood 0 or 1. Call exactly one of the two
        for each frame.
        """
        if isinstance(observation, np.ndarray) and observation.dtype == np.uint16:
            return (observation > 0).astype(np.float32)
        found = self.evidence(observation)
        return None if isinstance(found, Boxes) else found


def without_prior(posterior: Singles, prior: float) -> Singles:
    """The likelihood alone of a posterior float32 (v, u) of foreground under a prior, all 0..1, float32 (v, u).

    The fusion has a prior of its own, that of a cell being occupied; the pixel's prior would count it twice.
    """
    likelihood = np.empty_like(posterior)
    _divide_prior_out(posterior, np.float32(prior), likelihood)
    return likelihood


@wide_kernel
def _divide_prior_out(posterior: Singles, prior: np.float32, likelihood: Singles) -> None:
    """Fill likelihood (v, u); see `without_prior`."""
    one = np.float32(1)
    given, filled = posterior.reshape(-1), likelihood.reshape(-1)
    for i in range(len(given)):
        body, empty = given[i] * (one - prior), (one - given[i]) * prior
        filled[i] = body / (body + empty)


def mask_likelihood(mask: Bytes) -> Singles:
    """Foreground likelihood of a mask image.

    Parameters
    ----------
    mask : uint8 (v, u)
        0..255: certainly background to certainly foreground.

    Returns
    -------
    float32 (v, u)
        mask / 255. The fusion accounts for the segmenter's error rates.

    Raises
    ------
    SourceError
        Where it is not a grey image.
    """
    if mask.ndim != 2 or mask.dtype != np.uint8:
        raise SourceError("mask", "", f"{mask.dtype} {mask.shape}", "uint8 (v, u)")
    return np.asarray(_LIKELIHOOD_OF_GREY[mask])


def instance_boxes(instances: NDArray[np.uint16]) -> Boxes:
    """The tight box around each instance.

    Parameters
    ----------
    instances : uint16 (v, u)
        One value an instance, 0 for background.

    Returns
    -------
    Boxes
        In increasing order of the values that occur, score 1. Pixel centres are integers, so the box of the single
        pixel (u, v) is (u - 0.5, v - 0.5, 1, 1).

    Raises
    ------
    SourceError
        Where it is not an indexed image.
    """
    if instances.ndim != 2 or instances.dtype != np.uint16:
        raise SourceError("instances", "", f"{instances.dtype} {instances.shape}", "uint16 (v, u)")
    found = filter(None, find_objects(instances))  # None for values that do not occur
    pixel = [(u.start - 0.5, v.start - 0.5, u.stop - u.start, v.stop - v.start) for v, u in found]
    return Boxes(np.array(pixel, float).reshape(-1, 4), np.ones(len(pixel)))
