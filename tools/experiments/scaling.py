"""How the time of a frame grows with the ground, the views, the people and the pixels: measured, with exponents.

    python tools/experiment.py scaling [--axes area,views] [--kinds masks,boxes,video] [--sides 5,10,20,40,80]

One of the four is changed at a time; the others stay at 10 m x 10 m, 8 views, 10 people, 320 x 240 pixels. The area is
that of the grid alone: people and cameras stay where they are, so that the ground is all that grows. Costs are CPU
milliseconds a frame in one thread, tables and backgrounds made before, with the share of each stage. The exponent is
the slope of a line through all logarithms, behind it that of the last step. A ground of 80 m x 80 m takes 12 GiB of
memory and is measured when it is asked for.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from workbench import command_line, write_table

from stseg import Tracker
from stseg.arrays import Bytes, Observation
from stseg.geometry import Rig
from stseg.simulation import NAMED, SceneFilm
from stseg.simulation.rendering.render import RenderedView

AXES: dict[str, tuple[str, tuple[int, ...]]] = {
    "area": ("side of the ground, m", (5, 10, 20, 40)),
    "views": ("views", (2, 4, 8, 16)),
    "people": ("people", (1, 5, 10, 20, 50)),
    "pixels": ("width of the images, pixels", (160, 320, 640, 1280)),
}
"""What is changed, and the values that it takes."""
KINDS = ("masks", "boxes", "video")
_USUAL = {"area": 10, "views": 8, "people": 10, "pixels": 320}
_MOST_VIEWS, _READY, _MEASURED, _EMPTY = 16, 8, 64, 10
"""Views; frames before the clock starts, and while it runs; images from which a background is learned."""
_STAGES = ("foreground", "detection", "occupancy", "tracking")


@dataclass(frozen=True)
class Shown:
    """A filmed crowd: its rig, the views of each frame, and images of the empty scene by camera."""

    rig: Rig
    frames: list[tuple[RenderedView, ...]]
    empty: list[list[Bytes]]

    def by(self, views: int, side: float) -> Shown:
        """The same by some of the cameras, on a larger or smaller ground."""
        chosen = range(0, len(self.rig.cameras), len(self.rig.cameras) // views)
        grid = replace(self.rig.grid, x=(-side / 2, side / 2), y=(-side / 2, side / 2))
        rig = replace(self.rig, cameras=tuple(self.rig.cameras[k] for k in chosen), grid=grid)
        return Shown(rig, [tuple(views[k] for k in chosen) for views in self.frames], [self.empty[k] for k in chosen])

    def observed(self, kind: str) -> Iterator[list[Observation]]:
        """What the cameras deliver of each frame."""
        for views in self.frames:
            yield [one.boxes if kind == "boxes" else one.mask if kind == "masks" else one.image for one in views]


@cache
def crowd(people: int, width: int, views: int) -> Shown:
    """A crowd on 10 m x 10 m."""
    spec = replace(
        NAMED["easy"],
        area=(10.0, 10.0),
        camera_distance=9.0,
        people=people,
        cameras=views,
        stay=60.0,
        seconds=(_READY + _MEASURED) / 10,
        frame_rate=10.0,
        size=(width, width * 3 // 4),
    )
    film = SceneFilm(spec)
    empty = list(film.empty())[-_EMPTY:]
    return Shown(
        film.rig, [one.views for one in film.frame_sets()], [[images[k] for images in empty] for k in range(views)]
    )


def shown(axis: str, value: int) -> Shown:
    """The recording of one measurement."""
    asked = _USUAL | {axis: value}
    filmed = _MOST_VIEWS if axis == "views" else asked["views"]
    return crowd(asked["people"], asked["pixels"], filmed).by(asked["views"], asked["area"])


def cost(recording: Shown, kind: str) -> tuple[float, list[float]]:
    """CPU milliseconds a frame, and the share of each stage."""
    empty = {one.name: images for one, images in zip(recording.rig.cameras, recording.empty, strict=True)}
    tracker, results, start = Tracker(recording.rig, empty=empty if kind == "video" else None), [], 0.0
    for k, views in enumerate(recording.observed(kind)):
        if k == _READY:
            start = time.process_time()
        results += tracker.add(views)
    results += tracker.finish()
    taken = 1000 * (time.process_time() - start) / (len(recording.frames) - _READY)
    timings = np.concatenate([one.timings for one in results])
    seconds = [float(timings["seconds"][timings["stage"] == stage.encode()].sum()) for stage in _STAGES]
    return taken, [one / sum(seconds) for one in seconds]


def exponent(values: Sequence[int], taken: Sequence[float]) -> str:
    """Slope over all logarithms, and of the last step."""
    x, y = np.log(values), np.log(taken)
    return f"{np.polyfit(x, y, 1)[0]:.2f}, last {(y[-1] - y[-2]) / (x[-1] - x[-2]):.2f}"


def main() -> None:
    """Measure; write a table for each axis."""
    parser = command_line(__doc__)
    parser.add_argument("--axes", type=lambda text: text.split(","), default=list(AXES))
    parser.add_argument("--kinds", type=lambda text: text.split(","), default=list(KINDS))
    parser.add_argument("--sides", type=lambda text: [int(side) for side in text.split(",")], default=AXES["area"][1])
    asked = parser.parse_args()
    axes = AXES | {"area": (AXES["area"][0], tuple(asked.sides))}
    for axis in asked.axes:
        label, values = axes[axis]
        rows: list[list[object]] = [[label, *values, "exponent"]]
        for kind in asked.kinds:
            measured = [cost(shown(axis, value), kind) for value in values]
            taken = [one for one, _ in measured]
            rows.append([kind, *(f"{one:.1f}" for one in taken), exponent(values, taken)])
            print(*rows[-1], flush=True)
            for stage, own in zip(_STAGES, np.transpose([share for _, share in measured]), strict=True):
                rows.append([stage, *(f"{100 * one:.0f} %" for one in own), ""])
        write_table(asked.output / f"scaling_{axis}.csv", rows)
        crowd.cache_clear()
