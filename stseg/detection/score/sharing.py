"""What the candidates of a problem share: boxes and tracks."""

from __future__ import annotations

from typing import NamedTuple

from stseg.detection.problem import Problem
from stseg.detection.score.box_sharing import BoxSharing, box_sharing
from stseg.detection.score.track_sharing import TrackSharing, track_sharing
from stseg.kernels.accelerate import kernel


class Sharing(NamedTuple):
    """Boxes and tracks that candidates share."""

    boxes: BoxSharing
    tracks: TrackSharing


@kernel
def sharing_of(problem: Problem) -> Sharing:
    """What all candidates share; nobody continues a track yet."""
    return Sharing(
        box_sharing(problem.boxes, problem.parameters), track_sharing(problem.track_gain, problem.birth_cost)
    )
