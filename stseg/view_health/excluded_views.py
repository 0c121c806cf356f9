"""Views that are excluded although their camera delivers, as events of the run: where that begins and ends."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Observation, Rows, ViewEvidence
from stseg.records.tables import EVENT
from stseg.view_health.view_failures import ViewFailures

_NO_EVIDENCE = "is frozen, or its light changes: excluded"
_FAILS = "shows too little of the people that other views show: excluded"
_KNOCKED = "shows people beside their places, as after a push: excluded"


class ExcludedViews:
    """Events of the views of a session, frame by frame.

    Parameters
    ----------
    cameras
        Names of the cameras, in the rig's order.
    """

    def __init__(self, cameras: Sequence[str]) -> None:
        self._cameras = cameras
        self._since: list[int | None] = [None] * len(cameras)

    def events(
        self, frame: int, observations: Sequence[Observation], evidence: Sequence[ViewEvidence], failures: ViewFailures
    ) -> Rows:
        """EVENT rows of kind `blind` of the next frame.

        Parameters
        ----------
        frame
            Its number.
        seen, evidence
            What the cameras deliver, and what of it is evidence; None for nothing.
        failures
            The views that are excluded from it for what they show.
        """
        reasons = []
        for k, name in enumerate(self._cameras):
            since = self._since[k]
            excluded = observations[k] is not None and (evidence[k] is None or failures.excluded[k])
            if excluded and since is None:
                self._since[k] = frame
                reasons.append(f"camera {name} {_reason(evidence[k], bool(failures.knocks.knocked[k]))}")
            elif since is not None and not excluded and observations[k] is not None:
                self._since[k] = None
                reasons.append(f"camera {name} counts again, after {frame - since} frames")
        return np.array([(frame, b"blind", 0, 0, reason.encode()) for reason in reasons], EVENT)


def _reason(evidence: ViewEvidence, knocked: bool) -> str:
    if evidence is None:
        return _NO_EVIDENCE
    return _KNOCKED if knocked else _FAILS
