"""The variants of tracking that the table of results compares: the trackers, and the ablations of their papers."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["VARIANTS", "Variant"]


@dataclass(frozen=True)
class Variant:
    """One variant.

    Attributes
    ----------
    name
        In the table and in the names of run files.
    tracker
        Of `stseg run`.
    setting
        The constant by which it differs from that tracker's defaults.
    colour
        Whether it needs colour images.
    """

    name: str
    tracker: str
    setting: str = ""
    colour: bool = False

    @property
    def options(self) -> str:
        """Of `stseg run`."""
        return f"--tracker {self.tracker}" + (f" --set {self.setting}" if self.setting else "")


VARIANTS = {
    variant.name: variant
    for variant in (
        Variant("cut", "cut"),
        Variant("frames", "frames"),
        Variant("kalman", "kalman"),
        Variant("particles", "particles", colour=True),
        Variant("particles-search", "particles", "particles.method=search", True),
        Variant("particles-generic", "particles", "particles.method=generic", True),
        Variant("belief", "belief", colour=True),
        Variant("belief-condensation", "belief", "belief.method=condensation", True),
    )
}
"""In the order of the tables."""
