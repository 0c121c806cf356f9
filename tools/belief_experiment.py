"""DP06 figs 2 and 4, 5 simulated: a target hidden in one of two views, and one whose like passes by meanwhile.

    python tools/belief_experiment.py [--seeds 10] [--pictures docs/figures]

Two cameras of which nothing is used but the ground homography, and one target, whose box is given by hand in the first
frame, as the paper does. `hidden`: a screen hides it wholly in camera 1 for 140 frames. `similar`: an opponent
hides it in camera 1, while somebody in clothes of nearly the same colours passes close by. Each is followed by belief
propagation and by one Condensation filter a view, with each seed; a row tells in how many of the runs the estimate in a
view still is on the target at the end, and how far off it is meanwhile. Pictures show the first seed.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from stseg.arrays import Bytes, Floats
from stseg.config import BeliefConfig
from stseg.geometry import Camera
from stseg.geometry.upright import vertical_of
from stseg.simulation import Film, Route, SceneSpec
from stseg.trackers.belief.condensation import condense
from stseg.trackers.belief.particles import Motion
from stseg.trackers.belief.star import Star, propagate
from stseg.trackers.belief.target import Target, looks
from stseg.trackers.belief.view import StarView

PICTURES = Path(__file__).parents[1] / "docs" / "figures"
WAYS = {"condensation": condense, "belief": propagate}
HEIGHT = 1.75
_SCENE = SceneSpec(
    name="two views", people=1, area=(6.0, 6.0), seconds=10.0, frame_rate=25.0, cameras=3, camera_distance=6.5,
    size=(320, 240), distortion=(), seed=11,
)  # fmt: skip
_SCREENED = (50, 190)
"""Frames in which the screen hides the target: 140."""
_END = 25
"""Frames at the end over which a track is judged."""
_ON = 0.3
"""Overlap of the estimate's box with the true one from which the estimate is on the target."""
_GREEN, _WHITE, _RED = (90, 170, 60), (255, 255, 255), (60, 60, 230)


@dataclass(frozen=True)
class Experiment:
    """A scene, the moments to draw, and a screen in camera 1 if there is one."""

    spec: SceneSpec
    screened: bool
    shown: tuple[int, ...]


EXPERIMENTS = {
    "hidden": Experiment(
        replace(_SCENE, routes=(Route(HEIGHT, ((0.0, -2.2, 1.4), (4.6, 0.3, 0.2), (10.0, 0.6, -2.3))),)),
        True,
        (20, 90, 160, 240),
    ),
    "similar": Experiment(
        replace(
            _SCENE,
            people=3,
            alike=2,
            seed=154,
            routes=(
                Route(HEIGHT, ((0.0, 0.94, -1.30), (3.0, 0.00, 0.00), (6.4, 0.00, 0.00), (10.0, -1.05, 1.46))),
                Route(1.72, ((0.0, -2.63, -0.79), (3.4, -1.42, 0.09), (7.0, 0.28, -2.26), (10.0, 0.63, -2.75))),
                Route(1.80, ((0.0, 2.56, -0.13), (3.0, 0.46, 0.33), (6.2, 0.46, 0.33), (10.0, 0.92, 2.14))),
            ),
        ),
        False,
        (20, 110, 150, 240),
    ),
}


@dataclass(frozen=True)
class Recording:
    """What two cameras saw: images uint8 (time, view, v, u, 3), and where the target was, float64 (time, 2), metres."""

    views: list[StarView]
    images: Bytes
    truth: Floats
    hidden: int


def uncalibrated(camera: Camera) -> Camera:
    """The camera of which the ground homography alone is known."""
    return Camera(camera.name, camera.size, camera.ground, vertical_of(camera.ground, camera.size))


def film(experiment: Experiment) -> Recording:
    """The first two cameras' frames."""
    filmed = Film(experiment.spec)
    views = [StarView.of(uncalibrated(camera), filmed.rig.grid) for camera in filmed.rig.cameras[:2]]
    moments = list(filmed.moments())
    images = np.stack([[view.image for view in moment.views[:2]] for moment in moments])
    owner = np.stack([moment.views[0].instances for moment in moments])
    truth = np.array([route_place(experiment.spec, moment.frame) for moment in moments])
    hidden = 0
    if experiment.screened:
        screen = _screen(owner[slice(*_SCREENED)] == 1)
        hidden = sum(bool((person == 1).any() and not (person == 1)[~screen].any()) for person in owner)
        lots = np.random.default_rng(experiment.spec.seed)
        cloth = lots.integers(-12, 13, (*screen.shape, 3)) + np.array([70, 95, 80])
        images[:, 0][:, screen] = cloth[screen].astype(np.uint8)
    return Recording(views, images, truth, hidden)


def _screen(person: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """The smallest upright rectangle that hides a person in all these frames (time, v, u)."""
    rows, columns = np.flatnonzero(person.any((0, 2))), np.flatnonzero(person.any((0, 1)))
    screen = np.zeros(person.shape[1:], bool)
    screen[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1] = True
    return screen


def route_place(spec: SceneSpec, frame: int) -> Floats:
    """Where the target is in a frame, metres, float64 (2,)."""
    return spec.routes[0].ground(frame / spec.frame_rate)


def follow(recording: Recording, way: str, config: BeliefConfig) -> list[Star]:
    """The target's star in every frame after the first."""
    lots = np.random.default_rng(config.seed)
    motion = Motion(1 / _SCENE.frame_rate, config.wander, config.turn)
    target = Target.at(1, recording.truth[0], np.eye(2) * 0.05**2, HEIGHT, 2, config.count, lots)
    nobody = [np.zeros((0, 4))] * 2
    target.learn(recording.views, list(recording.images[0]), recording.truth[0], nobody, 1.0)
    stars = []
    for images in recording.images[1:]:
        asked = looks([target], recording.views, list(images), motion, config)
        (target.star,) = WAYS[way]([target.star], asked, motion, config, [lots])
        stars.append(target.star)
    return stars


def estimates(star: Star, views: list[StarView]) -> Floats:
    """Where each view believes the target to be, on the ground, metres, float64 (view, 2); nan where it does not."""
    return np.stack(
        [
            np.full(2, np.nan) if own is None else view.to_ground(own.mean[None])[0]
            for view, own in zip(views, star.views, strict=True)
        ]
    )


def overlap(one: Floats, other: Floats) -> float:
    """Intersection over union of two boxes."""
    sides = np.minimum(one[2:], other[2:]) - np.maximum(one[:2], other[:2])
    both = float(np.prod(sides.clip(0)))
    return both / float(np.prod(one[2:] - one[:2]) + np.prod(other[2:] - other[:2]) - both)


def judge(recording: Recording, path: Floats) -> tuple[Floats, Floats]:
    """Whether each view ends on the target, and its median error, metres; both (view,); path (time, view, 2)."""
    ends = []
    for j, view in enumerate(recording.views):
        pairs = zip(path[-_END:, j], recording.truth[1:][-_END:], strict=True)
        boxes = [view.boxes(np.stack(pair), HEIGHT) for pair in pairs]
        ends.append(float(np.median([np.nan_to_num(overlap(*pair)) for pair in boxes]) >= _ON))
    away = np.hypot(*np.moveaxis(path - recording.truth[1:, None], -1, 0))
    return np.array(ends), np.nanmedian(away, 0)


def picture(recording: Recording, runs: dict[str, list[Star]], shown: tuple[int, ...]) -> Bytes:
    """Rows: each way in each view; columns: moments. Particles as in the paper's figures, estimates in white."""
    rows = []
    for way, stars in runs.items():
        for j, view in enumerate(recording.views):
            cells = []
            for frame in shown:
                image, star = recording.images[frame, j].copy(), stars[frame - 1]
                for pixel in () if (own := star.views[j]) is None else own.place:
                    cv2.circle(image, _whole(pixel), 2, _GREEN, -1)
                where = estimates(star, recording.views)[j]
                _draw(image, view.boxes(recording.truth[frame][None], HEIGHT)[0], _RED)
                _draw(image, view.boxes(where[None], HEIGHT)[0], _WHITE)
                words = f"{way}, camera {j + 1}, frame {frame}"
                cv2.putText(image, words, (6, 16), cv2.FONT_HERSHEY_SIMPLEX, 0.42, (20, 20, 20), 1, cv2.LINE_AA)
                cells.append(image)
            rows.append(np.hstack(cells))
    return np.asarray(np.vstack(rows), np.uint8)


def _whole(pixel: Floats) -> tuple[int, int]:
    u, v = np.rint(pixel.clip(-1e4, 1e4)).astype(int)
    return int(u), int(v)


def _draw(image: Bytes, box: Floats, colour: tuple[int, int, int]) -> None:
    if np.isfinite(box).all():
        cv2.rectangle(image, _whole(box[:2]), _whole(box[2:]), colour, 2)


def compare(recording: Recording, seeds: int) -> tuple[list[str], dict[str, list[Star]]]:
    """A row of the table for each way, and the stars of each way with the first seed."""
    rows: list[str] = []
    first: dict[str, list[Star]] = {}
    for way in WAYS:
        kept, away, ground = [], [], []
        for seed in range(seeds):
            stars = follow(recording, way, replace(BeliefConfig(), seed=seed))
            ended, error = judge(recording, np.stack([estimates(star, recording.views) for star in stars]))
            off = np.array([star.ground.mean for star in stars]) - recording.truth[1:]
            kept.append(ended)
            away.append(error)
            ground.append(float(np.median(np.hypot(*off.T))))
            first.setdefault(way, stars)
        ends = [f"{count:.0f} of {seeds}" for count in np.sum(kept, 0)]
        errors = [f"{value:.2f}" for value in (*np.median(away, 0), np.median(ground))]
        rows.append(" | ".join([way, *ends, *errors]))
    return rows, first


def main() -> None:
    """Print the table and write the pictures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--pictures", type=Path, default=PICTURES)
    asked = parser.parse_args()
    print("| experiment | way | camera 1 ends on it | camera 2 | median error in camera 1, m | camera 2 | ground |")
    print("| --- | --- | ---: | ---: | ---: | ---: | ---: |")
    for name, experiment in EXPERIMENTS.items():
        recording = film(experiment)
        rows, first = compare(recording, asked.seeds)
        label = f"{name}, {recording.hidden} of {len(recording.truth)} frames" if experiment.screened else name
        print(*(f"| {label} | {row} |" for row in rows), sep="\n", flush=True)
        page = asked.pictures / f"belief_{name}.jpg"
        cv2.imwrite(str(page), picture(recording, first, experiment.shown), [cv2.IMWRITE_JPEG_QUALITY, 82])


if __name__ == "__main__":
    main()
