"""A run's own look at its rig: which view disagrees with the others by more than a cell, said at its end."""

from __future__ import annotations

from collections.abc import Sequence

from stseg.arrays import Boxes, Floats, Singles
from stseg.calibrate.blunders import all_bystanders
from stseg.calibrate.bystanders import tables_of
from stseg.calibrate.sightings import sightings
from stseg.calibrate.verdict import judge
from stseg.geometry import Rig

_MOST = 160
"""Frames that are kept; when there are more, every second one goes, and half as many are taken from then on."""


class ViewWatch:
    """Boxes of some frames of a run, evenly spread however long it becomes.

    Parameters
    ----------
    rig
        The rig that the run goes by.
    """

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self._every = 1
        self._shown: dict[int, list[Floats]] = {}

    def add(self, frame: int, seen: Sequence[Boxes | Singles | None]) -> None:
        """Take what the views show at a frame."""
        if frame % self._every:
            return
        self._shown[frame] = [sightings(one, camera.size) for one, camera in zip(seen, self.rig.cameras, strict=True)]
        if len(self._shown) > _MOST:
            self._every *= 2
            self._shown = {kept: boxes for kept, boxes in self._shown.items() if kept % self._every == 0}

    def warnings(self) -> list[str]:
        """A sentence for each view that is off by more than a cell; nothing where all is well or little is known."""
        if len(self.rig.cameras) < 3 or not self._shown:
            return []
        tables = tables_of(self.rig)
        people = all_bystanders(self.rig, tables, self._shown, sorted(self._shown))
        verdict = judge(self.rig, tables, people)
        return [
            f"{self.rig.cameras[one.view].name} is off: feet {100 * one.feet:.0f} cm, heads {100 * one.heads:.0f} cm "
            "from where the other views say"
            for one in verdict.named
        ]
