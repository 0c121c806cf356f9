"""From what a camera delivers to what the fusion asks for: a likelihood map, or boxes."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Boxes, Observation, Singles, ViewEvidence
from stseg.foreground.illumination import IlluminationMonitor, LightChange
from stseg.foreground.instances import instance_boxes
from stseg.foreground.masks import mask_likelihood


class ViewForeground:
    """One camera's way from observation to evidence.

    Parameters
    ----------
    background
        The model of the empty scene of a colour camera, its light watched; None for all others.
    """

    def __init__(self, background: IlluminationMonitor | None = None) -> None:
        self.background = background

    @property
    def light_changes(self) -> list[LightChange]:
        """When the light changed at once, in frames since the first that was asked for."""
        return [] if self.background is None else self.background.changes

    def evidence(self, seen: Observation) -> ViewEvidence:
        """What the frame shows; colour frames also teach the background model."""
        if seen is None and self.background is not None:
            self.background.skip()
        if seen is None or isinstance(seen, Boxes):
            return seen
        if seen.dtype == np.uint16:
            return instance_boxes(np.asarray(seen, np.uint16))
        if seen.ndim == 2:
            return mask_likelihood(np.asarray(seen, np.uint8))
        if self.background is None:
            raise ValueError("a colour frame needs a background model")
        posterior = self.background.likelihood(np.asarray(seen, np.uint8))
        return None if posterior is None else without_prior(posterior, self.background.model.prior)

    def pixels(self, seen: Observation) -> Singles | None:
        """How likely each pixel shows a person, float32 (v, u); None where the view is blind or delivers boxes.

        As `evidence`, but that the instances of an instance image are taken for certain, pixel by pixel. One of the two
        may be asked of a frame.
        """
        if isinstance(seen, np.ndarray) and seen.dtype == np.uint16:
            return (seen > 0).astype(np.float32)
        found = self.evidence(seen)
        return None if isinstance(found, Boxes) else found


def without_prior(posterior: Singles, prior: float) -> Singles:
    """What a posterior would be with a prior of one half: the evidence alone.

    The fusion has a prior of its own, that of a cell being occupied; one for the pixel besides would count it twice.

    Parameters
    ----------
    posterior : float32 (v, u)
        Probability of foreground, 0..1.
    prior
        The prior in it, 0..1.

    Returns
    -------
    float32 (v, u)
    """
    body, empty = posterior * np.float32(1 - prior), (1 - posterior) * np.float32(prior)
    return np.asarray(body / (body + empty), np.float32)
