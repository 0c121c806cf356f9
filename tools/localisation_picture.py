"""A frame's detection probability beside the marginal of its volume, with who was found and who is there."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.axes import Axes

from stseg.arrays import Floats


@dataclass(frozen=True)
class Shown:
    """Both maps of one frame, and the places that each way found.

    Attributes
    ----------
    lattice, cells : float64 (y, x, 2)
        Places of the two maps, metres.
    said, filled : float64 (y, x)
        log G and the volume's marginal, nats.
    found
        Places (n, 2) by the name of the way.
    """

    lattice: Floats
    said: Floats
    cells: Floats
    filled: Floats
    found: dict[str, Floats]


def picture(path: Path, shown: Shown, standing: Floats) -> None:
    """Draw both; people of the truth are rings, candidates crosses."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(10.4, 5.0), sharex=True, sharey=True, layout="constrained")
    _map(left, shown.lattice, shown.said.clip(0), "detection probability: log G, nats", standing)
    _map(right, shown.cells, shown.filled, "volume: marginal, nats", standing)
    for axes, start in ((left, "probability, modes"), (right, "volume, modes")):
        for (way, places), (mark, size) in zip(
            ((w, p) for w, p in shown.found.items() if w.startswith(start)), (("+", 130), ("x", 60)), strict=True
        ):
            axes.scatter(
                places[:, 0],
                places[:, 1],
                s=size,
                marker=mark,
                linewidths=1.6,
                c="tab:red",
                label=way.partition(", ")[2],
            )
        axes.legend(loc="upper left", fontsize=8, framealpha=0.9)
    left.set_ylabel("y, metres")
    figure.savefig(path, dpi=110, metadata={"Software": None})
    plt.close(figure)


def _map(axes: Axes, ground: Floats, weight: Floats, title: str, standing: Floats) -> None:
    mesh = axes.pcolormesh(ground[..., 0], ground[..., 1], weight, cmap="Greys", shading="nearest")
    axes.scatter(
        standing[:, 0], standing[:, 1], s=170, facecolors="none", edgecolors="tab:blue", linewidths=1.6, label="truth"
    )
    axes.set(title=title, xlabel="x, metres", aspect="equal")
    axes.figure.colorbar(mesh, ax=axes, shrink=0.8)
