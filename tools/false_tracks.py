"""HW12 table III: false trajectories with and without ghost removal, with and without the temporal check.

    python tools/false_tracks.py RIG TRUTH.csv [--frames A:B] [--ignore-flagged]

Each frame is explained by itself, as in the paper, and a Kalman filter follows either everybody whom the pass believed
(ghost removal) or all candidates that it weighed (none). The temporal check is the paper's: a trajectory of six frames
or fewer is dropped. A false trajectory is one that is matched in at most half of its frames, within half a metre.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from stseg.arrays import Rows
from stseg.config import Config
from stseg.engine.backgrounds import make_foregrounds
from stseg.engine.pipeline import Pipeline
from stseg.evaluation import evaluate
from stseg.io.recording.frames import open_frames
from stseg.io.recording.rigs import read_rig
from stseg.io.recording.stream_index import count_frames
from stseg.io.track_csv import read_tracks_csv
from stseg.model.expected import Expected
from stseg.model.people import People
from stseg.model.sizes import Sizes
from stseg.trackers import TRACKERS, Commit, FrameObservations, FusedFrame
from stseg.trackers.kalman import KalmanTracker

CHECK = 6
"""Frames: so few are no trajectory."""
_COLUMNS = (
    "| ghosts removed | temporal check | tracks | MT | ML | fragments | false tracks | frames of one | switches |"
)


class FrameByFrame(KalmanTracker):
    """Expects nobody, so that each frame is explained by itself."""

    def expected(self, frame: int) -> Expected | None:
        """Nobody."""
        del frame
        return None


class WithGhosts(FrameByFrame):
    """Follows ghosts, too."""

    def add(self, scene: FusedFrame, shown: FrameObservations) -> list[Commit]:
        """The next frame, its ghosts people."""
        return super().add(replace(scene, people=_together(scene.people, scene.ghosts)), shown)


def _together(people: People, ghosts: People) -> People:
    joined = {
        name.name: np.concatenate(
            [getattr(one, name.name) for one in (people, ghosts)], -1 if name.name in _BY_VIEW else 0
        )
        for name in fields(People)
        if name.name != "sizes"
    }
    sizes = (np.concatenate([getattr(one.sizes, name.name) for one in (people, ghosts)]) for name in fields(Sizes))
    return People(**joined, sizes=Sizes(*sizes))


_BY_VIEW = ("parts", "visible")
_BOTH: dict[str, Callable[..., KalmanTracker]] = {"no": WithGhosts, "yes": FrameByFrame}


def committed(rig_path: Path, first: int, stop: int) -> dict[str, Rows]:
    """Rows of both ways on one explanation of each frame."""
    recording, config = read_rig(rig_path), Config()
    kinds = ["boxes" if one.source.kind in ("boxes", "instances") else "pixels" for one in recording.sources]
    sights = make_foregrounds(recording, config, first, stop)
    TRACKERS["frame by frame"] = FrameByFrame
    pipeline = Pipeline(recording.rig, sights, kinds, config, "frame by frame")
    both = {name: make(recording.rig, config, first) for name, make in _BOTH.items()}
    rows: dict[str, list[Rows]] = {name: [] for name in both}
    unseen, done = FrameObservations((), ()), list[int]()
    with open_frames(recording, first, stop) as moments:
        for step in pipeline.steps(moments, first, done.append):
            for name, tracker in both.items():
                for scene in step.commit.scenes:
                    rows[name] += [commit.trajectory for commit in tracker.add(scene, unseen)]
    return {name: np.concatenate(own) for name, own in rows.items()}


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rig", type=Path)
    parser.add_argument("truth", type=Path)
    parser.add_argument("--frames", default="0:")
    parser.add_argument("--ignore-flagged", action="store_true")
    asked = parser.parse_args()
    head, _, tail = asked.frames.partition(":")
    first, stop = int(head or 0), int(tail) if tail else count_frames(read_rig(asked.rig))
    truth = read_tracks_csv(asked.truth)
    print(_COLUMNS, "| --- " * 9 + "|", sep="\n")
    for removed, rows in committed(asked.rig, first, stop).items():
        ids, counts = np.unique(rows["id"], return_counts=True)
        for check, kept in (("no", ids), ("yes", ids[counts > CHECK])):
            own = rows[np.isin(rows["id"], kept)]
            s = evaluate(truth, own, frames=np.arange(first, stop), ignore_flagged=asked.ignore_flagged)
            length = "" if s.false_track_frames is None else f"{s.false_track_frames:.1f}"
            print(
                f"| {removed} | {check} | {s.tracks} | {s.mostly_tracked} | {s.mostly_lost} | {s.fragments} | "
                f"{s.false_tracks} | {length} | {s.switches} |"
            )


if __name__ == "__main__":
    main()
