"""How many frames a second the trackers follow: python tools/bench_trackers.py [--frames 100] [TRACKER ...]

Four people under four cameras of 320 x 240 (scene `similar`). What is timed is the tracker alone, `expected` and `add`,
in seconds of the processor, of all threads together; the frames in which kernels are compiled are left out. Each
frame's people are those of the truth, as a pass without errors would find them.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from time import process_time

import numpy as np
from particles_experiment import film, people

from stseg.config import Config
from stseg.simulation.named_scenes import NAMED
from stseg.trackers import TRACKERS, FusedFrame, Tracker, find_tracker

WANTED = {"kalman": 200.0, "particles": 5.0, "belief": 5.0}
"""Trackers that are asked for, and the frames a second that each must reach."""
_WARM_UP = 5
_OCCUPIED = 3.0


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tracker", nargs="*", default=list(WANTED), help=f"of {', '.join(TRACKERS)}")
    parser.add_argument("--frames", type=int, default=100)
    asked = parser.parse_args()
    print("| tracker | frames/s | ms a frame, median | slowest tenth, ms | wanted, frames/s |")
    print("| --- | --- | --- | --- | --- |")
    for name in asked.tracker:
        taken = seconds(name, asked.frames)
        middle, slow = np.median(taken), np.quantile(taken, 0.9)
        wanted = f"{WANTED[name]:.0f}" if name in WANTED else ""
        print(f"| {name} | {1 / middle:.0f} | {1000 * middle:.1f} | {1000 * slow:.1f} | {wanted} |")


def seconds(name: str, frames: int) -> list[float]:
    """What each frame took a tracker, the first few left out."""
    spec = replace(NAMED["similar"], cameras=4)
    tracker: Tracker | None = None
    taken = []
    for rig, frame, truth, shown in film(spec, frames + _WARM_UP):
        tracker = tracker or find_tracker(name)(rig, Config(), 0)
        found, log_odds = people(truth, len(rig.cameras)), np.full(rig.grid.shape, -_OCCUPIED, np.float32)
        for place in found.ground:
            near = np.hypot(*np.moveaxis(rig.grid.ground - place, -1, 0)) < Config().occupancy.reach
            log_odds[:, near] = _OCCUPIED
        scene = FusedFrame(frame, found, people(truth[:0], len(rig.cameras)), log_odds)
        begin = process_time()
        tracker.expected(frame)
        tracker.add(scene, shown)
        taken.append(process_time() - begin)
    return taken[_WARM_UP:]


if __name__ == "__main__":
    main()
