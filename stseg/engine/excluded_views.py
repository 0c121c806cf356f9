"""Views that are excluded although their camera delivers, as events of the run: where that begins and ends."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Flags, Observation, Rows, ViewEvidence
from stseg.model.tables import EVENT

_NO_EVIDENCE = "is frozen, or its light changes: excluded"
_FAILS = "shows too little of the people that other views show: excluded"


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
        self, frame: int, seen: Sequence[Observation], evidence: Sequence[ViewEvidence], left_out: Flags
    ) -> Rows:
        """EVENT rows of kind `blind` of the next frame.

        Parameters
        ----------
        frame
            Its number.
        seen, evidence
            What the cameras deliver, and what of it is evidence; None for nothing.
        left_out : bool (view,)
            Views that fail (`stseg.detection.view_failures`).
        """
        reasons = []
        for k, name in enumerate(self._cameras):
            since = self._since[k]
            excluded = seen[k] is not None and (evidence[k] is None or left_out[k])
            if excluded and since is None:
                self._since[k] = frame
                reasons.append(f"camera {name} {_NO_EVIDENCE if evidence[k] is None else _FAILS}")
            elif since is not None and not excluded and seen[k] is not None:
                self._since[k] = None
                reasons.append(f"camera {name} counts again, after {frame - since} frames")
        return np.array([(frame, b"blind", 0, 0, reason.encode()) for reason in reasons], EVENT)
