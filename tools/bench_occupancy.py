"""How fast localisation is: 8 views of 480x720 float32 onto 100x100 cells on 10 planes, one thread.

    python tools/bench_occupancy.py [--rounds 15]

The peer is the papers' way (KS09 section 4.3): every map's logarithm is warped, whole, to the reference view through
each plane by cv2.warpPerspective, 80 warps of 480x720 pixels, and added up. All are run in turn in every round; the
figures are medians of each round's ratio. Maps are smooth noise. Gates: points at least 15 times as fast as the peer,
footprints, sums of the maps included, at least 6 times.

Then the fusion of the pipeline, people explained, on a simulated scene of four views and six people.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from functools import partial
from time import perf_counter

import cv2
import numpy as np

from stseg.arrays import Floats, Singles, ViewEvidence
from stseg.config import Config
from stseg.detection.detector import Detector
from stseg.geometry import Rig
from stseg.occupancy.fusion import ErrorRates
from stseg.occupancy.localisation import Localiser
from stseg.occupancy.volume import Occupancy
from stseg.simulation import Film, SceneSpec
from stseg.simulation.cameras import build_rig

SIZE = (720, 480)
VIEWS = 8
LEAST = 0.05
GATES = {"points": 15.0, "footprints": 6.0}


def bench_rig() -> Rig:
    """Eight cameras around ten by ten metres."""
    spec = SceneSpec(
        name="bench", people=0, area=(10.0, 10.0), seconds=1.0, cameras=VIEWS, camera_distance=9.0, camera_height=3.5,
        size=SIZE, distortion=(),
    )  # fmt: skip
    return build_rig(spec)


def smooth_noise() -> list[Singles]:
    """Maps with likelihoods between 0 and 1."""
    rng = np.random.default_rng(0)
    blurred = [cv2.GaussianBlur(rng.random(SIZE[::-1]), (0, 0), 5.0) for _ in range(VIEWS)]
    return [np.asarray((m - m.min()) / np.ptp(m), np.float32) for m in blurred]


def whole_warps(rig: Rig) -> Callable[[list[Singles]], list[Singles]]:
    """The peer: synergy maps in the first view, one a plane."""
    reference = rig.cameras[0]
    to_reference: list[list[Floats]] = [
        [camera.plane(z) @ np.linalg.inv(reference.plane(z)) for camera in rig.cameras] for z in rig.grid.heights
    ]
    warped = np.empty(SIZE[::-1], np.float32)
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP

    def localise(maps: list[Singles]) -> list[Singles]:
        logs = [cv2.log(np.maximum(seen, np.float32(LEAST))) for seen in maps]
        planes = []
        for homographies in to_reference:
            total = np.zeros(SIZE[::-1], np.float32)
            for log, homography in zip(logs, homographies, strict=True):
                cv2.warpPerspective(log, homography, SIZE, dst=warped, flags=flags)
                cv2.add(total, warped, dst=total)
            planes.append(total)
        return planes

    return localise


def seconds(call: Callable[[], object]) -> float:
    """How long a call takes."""
    start = perf_counter()
    call()
    return perf_counter() - start


def localisation(rounds: int) -> bool:
    """Print the times; whether the gates hold."""
    rig, maps, equal = bench_rig(), smooth_noise(), np.ones(VIEWS)
    points, footprints, peer = Localiser(rig, "point"), Localiser(rig, "footprint"), whole_warps(rig)
    rates = [ErrorRates(0.2, 0.07, 0.07)] * VIEWS
    ways: dict[str, Callable[[], object]] = {
        "whole warps": lambda: peer(maps),
        "points": lambda: points.synergy(maps, equal, LEAST),
        "footprints": lambda: footprints.synergy(maps, equal, LEAST),
        "footprints, log-odds": lambda: footprints.log_odds(maps, equal, rates, 0.02),
        "clutter weights": lambda: footprints.clutter_weights(maps),
    }
    for way in ways.values():
        way()
    taken = np.array([[seconds(way) for way in ways.values()] for _ in range(rounds)])
    ratios = np.median(taken[:, :1] / taken, axis=0)
    for name, time, ratio in zip(ways, np.median(taken, axis=0), ratios, strict=True):
        gate = f"   gate {GATES[name]:g}: {'met' if ratio >= GATES[name] else 'MISSED'}" if name in GATES else ""
        print(f"{name:24} {1e3 * time:8.2f} ms   {ratio:6.1f} times as fast{gate}")
    seen = (footprints.sampling.footprint[..., 2] > 0).mean()
    print(f"cells seen: {100 * seen:.0f} % of {rig.grid.shape} in {VIEWS} views; {rounds} rounds, one thread")
    return all(ratio >= GATES.get(name, 0.0) for name, ratio in zip(ways, ratios, strict=True))


def pipeline_fusion(frames: int) -> None:
    """Print the time of the fusion in the pipeline."""
    spec = SceneSpec(name="bench", people=6, area=(6.0, 6.0), seconds=frames / 10.0, camera_distance=6.8, seed=5)
    film, config = Film(spec), Config()
    for kind in ("pixels", "boxes"):
        frame_pass = Detector(film.rig, [kind] * 4, config.detection, config.body)
        occupancy = Occupancy(film.rig, [kind] * 4, config.occupancy, config.detection, config.body)
        taken = []
        for moment in film.frame_sets():
            seen: list[ViewEvidence] = [
                view.boxes if kind == "boxes" else (view.instances > 0).astype(np.float32) for view in moment.views
            ]
            fuse = partial(occupancy.fuse, seen, frame_pass.explain(seen, None))
            taken.append(seconds(fuse))
        told = f"{1e3 * np.median(taken[1:]):.2f} ms a frame"
        print(f"explained fusion, {kind}: {told}, 4 views of 480x360, {film.rig.grid.shape}, {frames} frames")


def main() -> None:
    """Run both; exit status 1 where a gate is missed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=15)
    asked = parser.parse_args()
    cv2.setNumThreads(1)
    met = localisation(asked.rounds)
    pipeline_fusion(10)
    sys.exit(0 if met else 1)


if __name__ == "__main__":
    main()
