"""What the removal of ghosts is worth: HW12's tables II and III on simulated scenes and real sets.

    python tools/ghost_experiment.py [--seeds 5] [--seconds 20] [--cameras 2,3,4] [--data ../shared/data]
        [--sets uu4,cmc1,cmc2] [--whole uu4,cmc1,cmc2,wildtrack] [--work build/results]

Simulated: five people in 5 m x 5 m, filmed in colour by four cameras a quarter turn apart (240x180), foreground by the
mixture; 2 and 3 cameras are the first ones. `before` takes every candidate for a person (tools/ghost_ways.py), `after`
whom the pass of the frame found. Both are followed by the same filter (`--tracker frames`), tracks as they were
committed. The temporal check is HW12's: tracks of six frames or fewer are dropped. A false track is one that is matched
in at most half of its frames, within 0.5 m. FPR is the share of what was found that is nobody, FNR that of people who
were not found.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from ablation import frames_of, prepared, score
from ghost_ways import EveryCandidate
from result_sets import SETS, ResultSet
from results import ROOT, Bench

from stseg.arrays import Rows
from stseg.config import Config
from stseg.detection.detector import Detector
from stseg.engine.backgrounds import make_foregrounds
from stseg.engine.pipeline import Pipeline
from stseg.evaluation import evaluate
from stseg.evaluation.scores import Scores
from stseg.foreground import make_background
from stseg.foreground.illumination import LightWatch
from stseg.foreground.view_foreground import ViewForeground
from stseg.geometry import Rig
from stseg.io.recording.frames import open_frames
from stseg.model.people import ViewEvidence
from stseg.simulation import Film, SceneSpec
from stseg.trackers.rows import trajectory_rows
from stseg.tracking.track_filter import TrackFilter

PASSES = {"before": EveryCandidate, "after": Detector}
CHECK = 6
"""Frames: tracks as short as that are dropped."""
_FIRST_SEED = 7100


@dataclass
class Following:
    """One way through a recording: people of each frame, followed.

    Parameters
    ----------
    rig
        Its first cameras are asked.
    kinds
        What they deliver.
    way
        One of PASSES.
    """

    rig: Rig
    kinds: Sequence[str]
    way: str
    rows: list[Rows] = field(default_factory=list)

    def __post_init__(self) -> None:
        config = Config()
        self.frame_pass = PASSES[self.way](self.rig, self.kinds, config.ghosts)
        self.walkers = TrackFilter(self.rig.frame_rate, config.ghosts, config.identity)

    def add(self, frame: int, seen: Sequence[ViewEvidence]) -> None:
        """The next frame."""
        found = self.frame_pass.explain(seen[: len(self.kinds)], self.walkers.expected(frame))
        people = found.people
        ids, none = self.walkers.follow(frame, people, found.ghosts), np.zeros(len(people))
        self.rows.append(
            trajectory_rows(
                frame,
                ids,
                people.ground,
                people.covariance,
                people.height,
                people.width,
                none,
                people.evidence,
                none.astype(np.int64),
            )
        )

    def tracks(self, shortest: int) -> Rows:
        """Rows of all tracks of more than so many frames."""
        rows = np.concatenate(self.rows)
        _, own, frames = np.unique(rows["id"], return_inverse=True, return_counts=True)
        return rows[frames[own] > shortest]


@dataclass(frozen=True)
class Outcome:
    """Scores of a way without and with the temporal check."""

    unchecked: Scores
    checked: Scores


def simulated(seed: int, seconds: float, cameras: Sequence[int]) -> dict[tuple[int, str], Outcome]:
    """Every way at every number of cameras, on one rendered scene."""
    spec = SceneSpec(
        name="ghosts", people=5, area=(5.0, 5.0), seconds=seconds, cameras=4, camera_distance=5.8, size=(240, 180),
        noise=2.5, shadows=0.3, stay=8.0, seed=seed,
    )  # fmt: skip
    film, config = Film(spec), Config()
    models = [make_background(camera.size, spec.frame_rate, config.foreground) for camera in film.rig.cameras]
    for images in film.empty():
        for model, image in zip(models, images, strict=True):
            model.learn(image)
    sights = [ViewForeground(LightWatch(model, spec.frame_rate, config.light)) for model in models]
    ways = {
        (number, way): Following(replace(film.rig, cameras=film.rig.cameras[:number]), ["pixels"] * number, way)
        for number in cameras
        for way in PASSES
    }
    truth = []
    for moment in film.moments():
        seen = [sight.evidence(view.image) for sight, view in zip(sights, moment.views, strict=True)]
        truth.append(moment.truth)
        for way in ways.values():
            way.add(moment.frame, seen)
    people, frames = np.concatenate(truth), np.arange(film.frames)
    return {
        name: Outcome(*(evaluate(people, way.tracks(shortest), frames=frames) for shortest in (0, CHECK)))
        for name, way in ways.items()
    }


def table_three(outcomes: dict[int, dict[tuple[int, str], Outcome]], cameras: Sequence[int]) -> Iterator[str]:
    """False tracks over all seeds, and what the removal loses."""
    yield "| cameras | ghost removal | temporal check | false tracks | mean length, frames | FPR % | FNR % |"
    yield "| --: | --- | --- | --: | --: | --: | --: |"
    for number in cameras:
        for way, word in (("before", "without"), ("after", "with")):
            for check in ("unchecked", "checked"):
                scores = [getattr(of[number, way], check) for of in outcomes.values()]
                count = sum(s.false_tracks for s in scores)
                length = sum((s.false_track_frames or 0.0) * s.false_tracks for s in scores) / max(count, 1)
                checked = "without" if check == "unchecked" else "with"
                yield f"| {number} | {word} | {checked} | {count} | {length:.1f} | {_rates(scores)} |"
    for number in cameras:
        before, after = ([of[number, way].checked for of in outcomes.values()] for way in PASSES)
        gone = 1 - sum(s.false_tracks for s in after) / max(sum(s.false_tracks for s in before), 1)
        lost = (sum(s.hits for s in before) - sum(s.hits for s in after)) / sum(s.truths for s in before)
        yield f"{number} cameras: of the false tracks left by the check {100 * gone:.1f} % go, and with them"
        yield f"{100 * lost:.2f} % of the true person-frames (below 0: more are found)"


def _rates(scores: Sequence[Scores]) -> str:
    hits, found, truths = (sum(getattr(s, name) for s in scores) for name in ("hits", "detections", "truths"))
    return f"{100 * (1 - hits / max(found, 1)):.1f} | {100 * (1 - hits / max(truths, 1)):.1f}"


def frame_by_frame(one: ResultSet, bench: Bench) -> dict[str, Scores]:
    """A real set, both ways: whom each frame showed."""
    recording, (first, stop), config = prepared(one, bench), frames_of(one), Config()
    kinds = ["boxes" if source.source.kind == "boxes" else "pixels" for source in recording.sources]
    ways = {way: Following(recording.rig, kinds, way) for way in PASSES}
    sights = make_foregrounds(recording, config, first, stop)
    with open_frames(recording, first, stop) as moments:
        for moment in moments:
            seen = [sight.evidence(view) for sight, view in zip(sights, moment.views, strict=True)]
            for way in ways.values():
                way.add(moment.frame, seen)
    return {name: score(one, way.tracks(0), bench) for name, way in ways.items()}


def whole(one: ResultSet, bench: Bench, way: str) -> Scores:
    """A real set by the whole pipeline, its pass replaced by one of PASSES."""
    recording, (first, stop), config = prepared(one, bench), frames_of(one), Config()
    kinds = ["boxes" if source.source.kind == "boxes" else "pixels" for source in recording.sources]
    pipeline = Pipeline(recording.rig, make_foregrounds(recording, config, first, stop), kinds, config, "cut")
    pipeline.frame_pass = PASSES[way](recording.rig, kinds, config.ghosts)
    done: list[int] = []
    with open_frames(recording, first, stop) as moments:
        steps = list(pipeline.steps(moments, first, done.append))
    committed, events = (np.concatenate([getattr(s.commit, name) for s in steps]) for name in ("trajectory", "events"))
    return score(one, pipeline.finished(committed, events)[0].trajectory, bench)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables as they come."""
    asked = _options(arguments)
    bench = Bench(asked.data.resolve(), asked.work.resolve())
    if asked.seeds:
        outcomes = {}
        for seed in range(_FIRST_SEED, _FIRST_SEED + asked.seeds):
            outcomes[seed] = simulated(seed, asked.seconds, asked.cameras)
            print(f"seed {seed} done", flush=True)
        print("\n".join(table_three(outcomes, asked.cameras)), flush=True)
    print("\n| set | FPR % before | after | FNR % before | after |\n| --- | --: | --: | --: | --: |")
    for name in asked.sets:
        by_way = frame_by_frame(SETS[name], bench)
        before, after = (_rates([by_way[way]]).split(" | ") for way in PASSES)
        print(f"| {name} | {before[0]} | {after[0]} | {before[1]} | {after[1]} |", flush=True)
    print("\n| set | ghost removal | MODA | IDF1 | switches | false tracks |\n| --- | --- | --: | --: | --: | --: |")
    for name in asked.whole:
        for way, word in (("before", "without"), ("after", "with")):
            s = whole(SETS[name], bench, way)
            print(f"| {name} | {word} | {s.moda:.1f} | {s.idf1:.1f} | {s.switches} | {s.false_tracks} |", flush=True)


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--cameras", type=lambda text: [int(n) for n in text.split(",")], default=[2, 3, 4])
    parser.add_argument("--sets", type=_names, default=["uu4", "cmc1", "cmc2"], help="for FPR and FNR")
    parser.add_argument("--whole", type=_names, default=["uu4", "cmc1", "cmc2", "wildtrack"], help="for whole tracks")
    parser.add_argument("--data", type=Path, default=ROOT / "../shared/data")
    parser.add_argument("--work", type=Path, default=ROOT / "build/results")
    return parser.parse_args(arguments)


def _names(text: str) -> list[str]:
    return [name for name in text.split(",") if name in SETS]


if __name__ == "__main__":
    main()
