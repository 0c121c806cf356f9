"""The ways of following that docs/results.md sets side by side: the trackers, and the ablations of their papers."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["WAYS", "Way"]


@dataclass(frozen=True)
class Way:
    """One way.

    Attributes
    ----------
    name
        In the keys of docs/results.json and in the names of run files.
    words
        In the tables.
    tracker
        Of `stseg run`.
    setting
        The constant by which it differs from that tracker's defaults.
    colour
        Whether it needs colour images.
    """

    name: str
    words: str
    tracker: str
    setting: str = ""
    colour: bool = False

    @property
    def options(self) -> str:
        """Of `stseg run`."""
        return f"--tracker {self.tracker}" + (f" --set {self.setting}" if self.setting else "")


WAYS = {
    way.name: way
    for way in (
        Way("cut", "cut", "cut"),
        Way("frames", "frames", "frames"),
        Way("kalman", "kalman", "kalman"),
        Way("particles", "particles", "particles", colour=True),
        Way("particles-search", "particles: search alone", "particles", "particles.way=search", True),
        Way("particles-generic", "particles: generic filter", "particles", "particles.way=generic", True),
        Way("belief", "belief", "belief", colour=True),
        Way("belief-condensation", "belief: each view by itself", "belief", "belief.way=condensation", True),
    )
}
"""In the order of the tables."""
