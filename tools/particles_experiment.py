"""The claims of KD06 on simulated scenes: who is kept, and how the error falls with the views.

    python tools/particles_experiment.py kept [--seeds 605,606,607] [--frames 1000] [-o PICTURE]
    python tools/particles_experiment.py views [--seeds 605,606,607] [--frames 300] [-o PICTURE]

The scene is `similar`: four people on 5 m x 5 m under three cameras of 320 x 240, three of them dressed alike, in a
light that changes. As in the paper's figure 5, trackers are told once, in the first frame, where the people are (the
paper does it by hand or from blobs that stand apart), and never again: nothing but colours and foreground holds them.
    search 1       one hypothesis that searches
    generic 15     15 particles that do not search
    guided 5, 15   5 and 15 particles that search
A person is held in a frame in which their own track is within half a metre of them, and lost where it is not at the
end (the mean of the last three seconds). `views` takes the guided filter to the same scene under 1 to 5 cameras, as the
paper's figure 4a. Times are of the tracker alone, in seconds of the processor.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import process_time

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from stseg.arrays import Floats, Rows
from stseg.config import Config, ParticleConfig
from stseg.foreground import make_background
from stseg.foreground.illumination import LightWatch
from stseg.foreground.view_foreground import ViewForeground
from stseg.geometry import Rig
from stseg.model.people import People
from stseg.model.sizes import Sizes
from stseg.simulation.film import Film
from stseg.simulation.named_scenes import NAMED
from stseg.simulation.scene import SceneSpec
from stseg.trackers import FrameObservations, FusedFrame
from stseg.trackers.particles import ParticleTracker

HELD = 0.5
"""Metres."""
_FOREVER = 1e6
WAYS: dict[str, ParticleConfig] = {
    "search 1": ParticleConfig(way="search", patience=_FOREVER),
    "generic 15": ParticleConfig(way="generic", patience=_FOREVER),
    "guided 5": ParticleConfig(count=5, patience=_FOREVER),
    "guided 15": ParticleConfig(patience=_FOREVER),
}


@dataclass
class Trial:
    """One tracker on one scene.

    Attributes
    ----------
    off
        For each frame the distance of each person from their own track, metres, float64 (person,); inf without one.
    seconds
        That the tracker took in all.
    """

    tracker: ParticleTracker
    off: list[Floats] = field(default_factory=list)
    seconds: float = 0.0

    def add(self, scene: FusedFrame, shown: FrameObservations, truth: Rows) -> None:
        """The next frame; tracks are numbered as the truth of the first frame is."""
        begin = process_time()
        (commit,) = self.tracker.add(scene, shown)
        self.seconds += process_time() - begin
        places = {int(row["id"]): (row["x"], row["y"]) for row in commit.trajectory}
        self.off.append(
            np.array(
                [
                    np.hypot(*(np.array(places[k + 1]) - (row["x"], row["y"]))) if k + 1 in places else np.inf
                    for k, row in enumerate(truth)
                ]
            )
        )

    def held(self) -> Floats:
        """Share of the frames in which each person is held, float64 (person,)."""
        return np.asarray((np.array(self.off) < HELD).mean(0))

    def kept(self, frame_rate: float) -> int:
        """How many people are held at the end."""
        last = np.array(self.off)[-round(3 * frame_rate) :]
        return int(((last < HELD).mean(0) > 0.5).sum())

    def error(self) -> float:
        """Mean distance where people are held, metres."""
        off = np.array(self.off)
        return float(off[off < HELD].mean())


def film(spec: SceneSpec, frames: int) -> Iterator[tuple[Rig, int, Rows, FrameObservations]]:
    """Frames of a scene with its truth, images and foreground, the background learned from the empty room."""
    recording, config = Film(spec), Config()
    models = [make_background(camera.size, spec.frame_rate, config.foreground) for camera in recording.rig.cameras]
    for images in recording.empty():
        for model, image in zip(models, images, strict=True):
            model.learn(image)
    sights = [ViewForeground(LightWatch(model, spec.frame_rate, config.light)) for model in models]
    for moment in recording.moments():
        if moment.frame == frames:
            return
        images = tuple(view.image for view in moment.views)
        evidence = [sight.evidence(image) for sight, image in zip(sights, images, strict=True)]
        yield recording.rig, moment.frame, moment.truth, FrameObservations(images, evidence)


def people(truth: Rows, views: int) -> People:
    """People as a pass finds them: where they are."""
    n, ground = len(truth), np.column_stack([truth["x"], truth["y"]])
    sure, ones = np.full(n, 6.0), np.ones((views, n))
    sizes = Sizes.of_heights(truth["height"].astype(float), np.full(n, 0.03**2), Config().ghosts)
    return People(
        ground, sizes.height, sizes.width, np.tile(np.eye(2) * 0.01, (n, 1, 1)), sure, ones, ones, np.zeros(n),
        np.full(n, -1), sizes,
    )  # fmt: skip


def trials(spec: SceneSpec, frames: int, ways: dict[str, ParticleConfig]) -> dict[str, Trial]:
    """All ways on the same frames."""
    found: dict[str, Trial] = {}
    for rig, frame, truth, shown in film(spec, frames):
        found = found or {
            name: Trial(ParticleTracker(rig, replace(Config(), particles=config), 0)) for name, config in ways.items()
        }
        views = len(rig.cameras)
        nothing = np.full(rig.grid.shape, -3.0, np.float32)
        scene = FusedFrame(frame, people(truth if frame == 0 else truth[:0], views), people(truth[:0], views), nothing)
        for trial in found.values():
            trial.add(scene, shown, truth)
    return found


def kept(seeds: Sequence[int], frames: int, picture: Path) -> None:
    """KD06 figure 5."""
    done = {seed: trials(replace(NAMED["similar"], seed=seed), frames, WAYS) for seed in seeds}
    print("| way | seed | people kept to the end | held, each person | error while held, m | ms a frame |")
    print("| --- | --- | --- | --- | --- | --- |")
    for way in WAYS:
        for seed, ways in done.items():
            trial = ways[way]
            held = ", ".join(f"{100 * share:.0f} %" for share in trial.held())
            count = f"{trial.kept(NAMED['similar'].frame_rate)} of {len(trial.off[0])}"
            print(f"| {way} | {seed} | {count} | {held} | {trial.error():.3f} | {1000 * trial.seconds / frames:.0f} |")
    _draw_kept(done[seeds[0]], seeds[0], picture)


def _draw_kept(ways: dict[str, Trial], seed: int, picture: Path) -> None:
    """Distance of each person from their own track over time."""
    figure, axes = plt.subplots(len(ways), 1, figsize=(9, 1.7 * len(ways)), sharex=True, constrained_layout=True)
    for axis, (way, trial) in zip(axes, ways.items(), strict=True):
        for k, off in enumerate(np.array(trial.off).T):
            axis.plot(np.minimum(off, 3.0), lw=0.9, label=f"person {k + 1}" + (", alike" if k < 3 else ""))
        axis.axhline(HELD, color="0.5", lw=0.7, ls=":")
        axis.set(ylim=(0, 3), ylabel="off, m", title=way)
        axis.title.set_fontsize(9)
    axes[0].legend(ncols=4, fontsize=7, loc="upper right")
    axes[-1].set_xlabel(f"frame of scene similar, seed {seed}; dotted: held")
    _save(figure, picture)


def views(seeds: Sequence[int], frames: int, picture: Path) -> None:
    """KD06 figure 4a."""
    counts = (1, 2, 3, 4, 5)
    print("| views | seed | people kept to the end | held | error while held, m |")
    print("| --- | --- | --- | --- | --- |")
    errors = []
    for count in counts:
        for seed in seeds:
            spec = replace(NAMED["similar"], seed=seed, cameras=count)
            (trial,) = trials(spec, frames, {"guided 15": WAYS["guided 15"]}).values()
            off = np.minimum(np.array(trial.off), 3.0)
            errors.append((count, float(off.mean()), trial.error()))
            people_kept = f"{trial.kept(spec.frame_rate)} of {len(trial.off[0])}"
            print(f"| {count} | {seed} | {people_kept} | {100 * trial.held().mean():.0f} % | {trial.error():.3f} |")
    figure, axis = plt.subplots(figsize=(5, 3.2), constrained_layout=True)
    every, held = (np.array([[e[k] for e in errors if e[0] == c] for c in counts]) for k in (1, 2))
    axis.plot(counts, every.mean(1), "o-", label="all frames (at most 3 m)")
    axis.plot(counts, held.mean(1), "s-", label="while held")
    axis.set(xlabel="views", ylabel="mean distance, m", ylim=(0, None), xticks=counts)
    axis.legend(fontsize=8)
    _save(figure, picture)


def _save(figure: Figure, picture: Path) -> None:
    picture.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(picture, metadata={"Date": None})
    print(picture)


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("experiment", choices=("kept", "views"))
    parser.add_argument("--seeds", type=lambda text: [int(seed) for seed in text.split(",")], default=[605, 606, 607])
    parser.add_argument("--frames", type=int)
    parser.add_argument("-o", "--output", type=Path)
    asked = parser.parse_args()
    plt.rcParams["svg.hashsalt"] = "stseg"
    output = asked.output or Path(f"docs/figures/particles_{asked.experiment}.svg")
    if asked.experiment == "kept":
        kept(asked.seeds, asked.frames or NAMED["similar"].frames, output)
    else:
        views(asked.seeds, asked.frames or 300, output)


if __name__ == "__main__":
    main()
