"""The views of a frame that deliver colour images, with their foreground."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from stseg.arrays import Boxes, Bytes, Observation, Singles
from stseg.errors import SourceError
from stseg.trackers.protocol import FrameObservations


class ColourView(NamedTuple):
    """A colour image and its foreground."""

    image: Bytes
    """uint8 (v, u, 3): BGR."""
    likelihood: Singles
    """float32 (v, u): of foreground, 0..1."""


def colour_views(observed: FrameObservations, tracker: str, frame: int) -> list[ColourView | None]:
    """The colour views of a frame, in the rig's order; None for a blind view and one without colour.

    Raises
    ------
    SourceError
        Where no view that delivers anything delivers colour.
    """
    views = [
        _view(observation, evidence)
        for observation, evidence in zip(observed.observations, observed.evidence, strict=True)
    ]
    observations = [observation for observation in observed.observations if observation is not None]
    if observations and not any(_is_colour(observation) for observation in observations):
        raise SourceError(
            f"--tracker {tracker}",
            f"frame {frame}",
            f"{_kinds(observations)} and no colour",
            "a camera that delivers colour images: this tracker knows people by their clothes",
        )
    return views


def _view(observation: Observation, evidence: object) -> ColourView | None:
    if observation is None or isinstance(observation, Boxes) or not _is_colour(observation):
        return None
    if not isinstance(evidence, np.ndarray):  # the view is blind while it learns a new light
        return None
    return ColourView(np.asarray(observation, np.uint8), evidence)


def _is_colour(observation: Observation) -> bool:
    return isinstance(observation, np.ndarray) and observation.ndim == 3


def _kinds(observations: Sequence[Observation]) -> str:
    rasters = [None if isinstance(one, Boxes) else np.asarray(one).dtype for one in observations]
    kinds = {"boxes" if dtype is None else "instances" if dtype == np.uint16 else "masks" for dtype in rasters}
    return " and ".join(sorted(kinds))
