"""How fast the pass of a frame is: who is there and where, one thread; pixel labels: tools/bench_labels.py.

    python tools/bench_ghosts.py [--frames 20] [--people 3,5,7,9] [--groups 1,2,4,8] [--candidates probability]

Positions and statuses: simulated people seen by four cameras a quarter turn apart, as silhouettes and as a detector's
boxes; each frame is expected from those before, as in a run. A candidate is a place that the settled search weighed,
person or ghost; `--candidates` says from where they come beside tracks, which takes its own time
(`proposals.source`).
Gate: 20 frames/s where ten are weighed.

Groups: one frame's candidates so many times over, in rooms whose evidence does not touch. Gate: a group of many takes
at most a tenth more than one of few.

Seconds are those of the processor, which other programs on the machine hardly change.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from stseg.arrays import ViewEvidence
from stseg.config import Config
from stseg.detection.detector import Detector
from stseg.detection.map_estimate import FrameEvidence, MapEstimate
from stseg.detection.prior import Prior
from stseg.detection.problem import BoxEvidence, PixelEvidence, Problem
from stseg.detection.proposals import Proposals
from stseg.detection.search import ENUMERATED, search
from stseg.model.candidates import Candidates
from stseg.occupancy.volume import Occupancy
from stseg.simulation import Film, SceneSpec
from stseg.tracking.track_filter import TrackFilter

WEIGHED, GATE, SLACK = 10, 20.0, 1.1
_WARM = 3
_REPEATS = 5


def evidence(people: int, frames: int, kind: str) -> tuple[Film, list[list[ViewEvidence]]]:
    """What four views show of so many people, frame by frame."""
    spec = SceneSpec(
        name="bench", people=people, area=(6.0, 6.0), seconds=(frames + _WARM) / 10, cameras=4, camera_distance=6.8,
        size=(320, 240), seed=11,
    )  # fmt: skip
    film = Film(spec)
    seen: list[list[ViewEvidence]] = [
        [view.boxes if kind == "boxes" else (view.instances > 0).astype(np.float32) for view in moment.views]
        for moment in film.frame_sets()
    ]
    return film, seen


def positions(people: int, frames: int, kind: str, config: Config) -> tuple[float, float]:
    """Candidates weighed and seconds, both a frame."""
    film, seen = evidence(people, frames, kind)
    kinds = [kind] * 4
    candidates, fuse = (
        Proposals(film.rig, kinds, config),
        Occupancy(film.rig, kinds, config.occupancy, config.detection, config.body).fuse,
    )
    frame_pass = Detector(film.rig, [kind] * 4, config.detection, config.body)
    follow = TrackFilter(film.rig.frame_rate, config)
    taken, weighed = [], []
    for frame, views in enumerate(seen):
        start = time.process_time()
        found = frame_pass.explain(views, follow.predict(frame), candidates.of(views, fuse))
        taken.append(time.process_time() - start)
        follow.update(frame, found.people, found.ghosts)
        weighed.append(len(found.people) + len(found.ghosts))
    return float(np.mean(weighed[_WARM:])), float(np.mean(taken[_WARM:]))


def rooms(problem: Problem, number: int) -> Problem:
    """A problem so many times over, side by side: nothing in one room bears on another."""
    n, room = len(problem.height_prior), np.repeat(np.arange(number), len(problem.height_prior))
    same = room[:, None] == room
    boxes, pixels = problem.boxes, problem.pixels
    rows, most, walkers = pixels.raster.shape[1], boxes.match.shape[2], problem.track_gain.shape[1]
    match = np.full((len(boxes.match), n * number, most * number), -np.inf)
    known = np.full((n * number, walkers * number), -1e3)
    for k in range(number):
        own = slice(k * n, (k + 1) * n)
        for view, count in enumerate(boxes.boxes):
            match[view, own, k * count : (k + 1) * count] = boxes.match[view, :, :count]
        known[own, k * walkers : (k + 1) * walkers] = problem.track_gain
    first = np.tile(pixels.first, (1, number))
    more_boxes = BoxEvidence(
        match,
        boxes.boxes * number,
        np.tile(boxes.cover, (1, number, number)) * same,
        np.tile(boxes.inside, (1, number)),
    )
    more_pixels = PixelEvidence(
        np.tile(pixels.raster, (1, number, 1)),
        np.where(first < 0, -1, first + rows * room),
        np.tile(pixels.spans, (1, number, 1, 1)),
        np.tile(pixels.area, (1, number)),
        np.tile(pixels.order, (1, number)),
    )
    return Problem(
        more_boxes, more_pixels, np.tile(problem.height_prior, number), np.tile(problem.birth_cost, number), known,
        np.tile(problem.ground, (number, 1)) + 100.0 * room[:, None], problem.parameters,
        np.empty(max(more_pixels.raster[:1].size, match.shape[2], known.shape[1], 1), np.int64),
        np.zeros((len(problem.view_evidence), n * number + 1)),
    )  # fmt: skip


def search_seconds(problem: Problem) -> float:
    """The best of some searches of a problem from nobody."""
    best = np.inf
    for _ in range(_REPEATS):
        start = time.process_time()
        search(np.zeros(len(problem.height_prior) + 1, np.int64), 0, problem, ENUMERATED, 2)
        best = min(best, time.process_time() - start)
    return best


def one_case(kind: str) -> Problem:
    """All that is known of the candidates of one frame, five people in view."""
    film, seen = evidence(5, 1, kind)
    frame_pass, views = Detector(film.rig, [kind] * 4, Config().detection, Config().body), seen[-1]
    found = frame_pass.explain(views, None)
    sights = [view.observe(shown) for view, shown in zip(frame_pass.views, views, strict=True)]
    state = FrameEvidence(
        frame_pass.views,
        sights,
        Prior.of(None, Config().detection, Config().body, frame_pass.border),
        frame_pass.parameters,
    )
    people, ghosts = (Candidates(some.ground, some.height, some.width) for some in (found.people, found.ghosts))
    pool = people.joined_with(ghosts)
    return MapEstimate.of_search(state, pool, np.zeros(0, np.int64)).problem


def main(arguments: Sequence[str] | None = None) -> None:
    """Print both tables; exit status 1 where a gate is missed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=20)
    parser.add_argument("--people", type=lambda text: [int(n) for n in text.split(",")], default=[3, 5, 7, 9])
    parser.add_argument("--groups", type=lambda text: [int(n) for n in text.split(",")], default=[1, 2, 4, 8])
    sources = ("lattice", "probability", "volume", "both")
    parser.add_argument("--candidates", choices=sources, default=Config().proposals.source)
    asked = parser.parse_args(arguments)
    config = replace(Config(), proposals=replace(Config().proposals, source=asked.candidates))
    met = True
    print("| evidence | people | candidates weighed | ms a frame | frames/s |\n| --- | --: | --: | --: | --: |")
    for kind in ("pixels", "boxes"):
        rows = [(people, *positions(people, asked.frames, kind, config)) for people in asked.people]
        for people, weighed, seconds in rows:
            print(f"| {kind} | {people} | {weighed:.1f} | {1e3 * seconds:.1f} | {1 / seconds:.1f} |", flush=True)
        enough = min((row for row in rows if row[1] >= WEIGHED), default=rows[-1])
        met &= 1 / enough[2] >= GATE
        print(f"gate, {kind}: {1 / enough[2]:.1f} frames/s where {enough[1]:.1f} are weighed, {GATE:g} at {WEIGHED}")
    print("\n| evidence | groups | candidates | ms a search | ms a group |\n| --- | --: | --: | --: | --: |")
    for kind in ("pixels", "boxes"):
        problem = one_case(kind)
        search_seconds(problem)
        times = {number: search_seconds(rooms(problem, number)) for number in asked.groups}
        for number, seconds in times.items():
            each = 1e3 * seconds / number
            print(
                f"| {kind} | {number} | {number * len(problem.height_prior)} | {1e3 * seconds:.2f} | {each:.2f} |",
                flush=True,
            )
        few, many = min(times), max(times)
        met &= times[many] / many <= SLACK * times[few] / few
    sys.exit(0 if met else 1)


if __name__ == "__main__":
    main()
