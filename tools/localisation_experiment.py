"""Model-driven against data-driven localisation (HW12 section V.C): the tables and the picture of docs/localisation.md.

    python tools/localisation_experiment.py [--sets uu4,easy,dense4,dense4:3,cmc1,wildtrack] [--every 5] [--least 20]
        [--set stage.key=value]... [--torn 0.3] [--picture docs/figures/localisation.png] [--data ../shared/data]
        [--work build/results]

Each frame is taken by itself, nobody is expected from those before (colour sets' backgrounds see all frames).
`dense4:3` are the first three cameras of `dense4`. Ways:

- probability: modes of the target detection probability (model-driven), or its local maxima;
- hull: modes of HW12's voxel histogram, its data-driven way: a voxel counts where all views that see it, two or more,
  show foreground with more than one half;
- volume: the same of the marginal of the calibrated volume, soft, before anybody is explained; or its local maxima;
- pass, lattice: the candidates that the pass of the frame would begin with, before any is a ghost;
- pass: the people whom it finds.

`C` is the kernel of the mean shift, metres (HW12: 0.80). A candidate matches a person within 0.5 m, one to one, as the
set is scored in docs/results.md. `error` is the distance of those matched; `same` its mean over the people whom both
the probability's and the volume's modes of the default kernel find: nobody gains by missing who is hard to place.
With --torn, so large a share of every view's map is erased in squares of a twelfth of the image's height, as where
clothes look like the background; sets of boxes are left out.
"""

from __future__ import annotations

import argparse
import shlex
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np
from ablation import area_of, frames_of, prepared
from ablation_ways import some_views
from localisation_picture import Shown, picture
from result_sets import SETS, ResultSet
from results import ROOT, Bench
from scipy.ndimage import maximum_filter

from stseg.arrays import Boxes, Floats, Rows
from stseg.config import Config, DetectionConfig
from stseg.detection.detection_probability import DetectionProbability
from stseg.detection.detector import Detector
from stseg.detection.map_estimate import FrameEvidence, MapEstimate
from stseg.detection.mean_shift import modes
from stseg.detection.prior import Prior
from stseg.detection.proposals import map_steps, marginal, soft_maps, weights
from stseg.engine.backgrounds import make_foregrounds
from stseg.evaluation.matching import match
from stseg.evaluation.sequence import line_up
from stseg.foreground import box_likelihood
from stseg.geometry.summed_area import TOP, UNSEEN
from stseg.io.config_file import read_config
from stseg.io.recording.frames import open_frames
from stseg.io.recording.recording import Recording
from stseg.io.track_csv import read_tracks_csv
from stseg.model.people import ViewEvidence, empty_explanation
from stseg.model.tables import TRAJECTORY
from stseg.occupancy.volume import Occupancy

GATE = 0.5
KERNELS = (0.80, DetectionConfig().kernel)
_SQUARES = 12
T = TypeVar("T")
_MODEL, _DATA = "probability, modes", "volume, modes"


@dataclass
class Ways:
    """All ways on one rig, and what each takes.

    Parameters
    ----------
    recording
        The set's cameras and what they deliver.
    config
        The constants of all ways.
    """

    recording: Recording
    config: Config
    seconds: dict[str, list[float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        rig, config = self.recording.rig, self.config
        kinds = ["boxes" if source.source.kind == "boxes" else "pixels" for source in self.recording.sources]
        self.probability = DetectionProbability(rig, config.detection, map_steps(rig, kinds))
        self.occupancy = Occupancy(rig, kinds, config.occupancy, config.ghosts, config.level)
        self.frame_pass = Detector(rig, kinds, config.ghosts)

    def places(self, seen: Sequence[ViewEvidence]) -> tuple[dict[str, Floats], Shown]:
        """Ground places (n, 2) that each way finds in a frame, and the two maps."""
        one, other, grid = self.probability, self.occupancy, self.recording.rig.grid
        said = self._timed("probability", lambda: one.log_ratio(soft_maps(one, seen)))
        volume = self._timed("volume", lambda: other.fuse(seen, empty_explanation(other.rig, seen)))
        hull = self._timed("hull", lambda: self._hull(seen))
        filled, found = marginal(volume), {}
        for kernel in KERNELS:
            for name, weight, ground, spacing in (
                (_MODEL, weights(said), one.ground, one.spacing),
                ("hull, modes", hull, grid.ground, grid.cell),
                (_DATA, filled, grid.ground, grid.cell),
            ):
                way = f"{name}, C {kernel:.2f}"
                found[way] = self._timed(way, partial(modes, weight, ground, spacing, kernel)).ground
        found["probability, maxima"] = _maxima(np.where(said > 0, said, 0.0), one.ground)
        found["volume, maxima"] = _maxima(filled, grid.ground)
        found["pass, lattice"] = self._timed("pass, lattice", lambda: self._lattice(seen))
        found["pass"] = self._timed("pass", lambda: self.frame_pass.explain(seen, None).people.ground)
        return found, Shown(one.ground, said, grid.ground, filled, found)

    def _hull(self, seen: Sequence[ViewEvidence]) -> Floats:
        """Voxels of the visual hull in each column, float64 (y, x)."""
        inside, views = np.ones(self.recording.rig.grid.shape), np.zeros(self.recording.rig.grid.shape)
        for k, (view, camera) in enumerate(zip(seen, self.recording.rig.cameras, strict=True)):
            if view is not None:
                shown = box_likelihood(view, camera.size) if isinstance(view, Boxes) else view
                levels = self.occupancy.means.levels(k, shown)
                inside *= (levels == UNSEEN) | (levels > TOP / 2)
                views += levels != UNSEEN
        return np.asarray((inside * (views >= 2)).sum(0))

    def _lattice(self, seen: Sequence[ViewEvidence]) -> Floats:
        """Candidates of the pass's first round, nobody explained."""
        views, config = self.frame_pass.views, self.frame_pass.config
        sights = [None if s is None else view.observe(s) for view, s in zip(views, seen, strict=True)]
        prior = Prior.of(None, config, self.frame_pass.border)
        first = MapEstimate(
            FrameEvidence(views, sights, prior, self.frame_pass.terms), prior.pool(), np.zeros(0, np.int64)
        )
        return self.frame_pass.fresh(first).ground

    def _timed(self, name: str, ask: Callable[[], T]) -> T:
        start = time.process_time()
        found = ask()
        self.seconds.setdefault(name, []).append(time.process_time() - start)
        return found


def torn(seen: Sequence[ViewEvidence], share: float, lots: np.random.Generator) -> list[ViewEvidence]:
    """Maps of which squares are erased."""
    found: list[ViewEvidence] = []
    for view in seen:
        assert view is None or isinstance(view, np.ndarray)
        if view is not None:
            side = -(-view.shape[0] // _SQUARES)
            kept = lots.random((_SQUARES, -(-view.shape[1] // side))) >= share
            view = view * kept.repeat(side, 0).repeat(side, 1)[: view.shape[0], : view.shape[1]]
        found.append(view)
    return found


def _maxima(weight: Floats, ground: Floats) -> Floats:
    """Places of a lattice that no neighbour exceeds."""
    return np.asarray(ground[(weight == maximum_filter(weight, 3)) & (weight > 0)])


@dataclass(frozen=True)
class Judged:
    """What one way found: matched people by frame and person, and counts."""

    distance: dict[tuple[int, int], float]
    people: int
    found: int


def judged(one: ResultSet, bench: Bench, rows: Rows, frames: Sequence[int]) -> Judged:
    """Match one way's places, as the set is scored."""
    assert one.truth is not None
    options, truth = shlex.split(one.scoring), read_tracks_csv(bench.path(one.truth))
    lined = line_up(truth, rows, GATE, area_of(one), np.array(frames), "--ignore-flagged" in options)
    distance = {}
    for k, frame in enumerate(lined.frames):
        for row, column in zip(*match(frame.distance, GATE), strict=True):
            distance[k, int(frame.person[row])] = float(frame.distance[row, column])
    return Judged(distance, lined.truths, lined.detections)


def measured(name: str, bench: Bench, asked: argparse.Namespace) -> Iterator[str]:
    """Rows of the table for one set; draws the picture where it is asked for."""
    (one, recording), config = _recording(name, bench), read_config(None, tuple(asked.set))
    (first, stop), ways = frames_of(one), Ways(recording, config)
    frames = range(first, stop, max(1, min(asked.every, (stop - first) // asked.least)))
    found: dict[str, list[Rows]] = {}
    lots = np.random.default_rng(0)
    sights = make_foregrounds(recording, config, first, stop)
    with open_frames(recording, first, stop) as moments:
        for moment in moments:
            seen = [sight.evidence(view) for sight, view in zip(sights, moment.views, strict=True)]
            if moment.frame not in frames:
                continue
            places, shown = ways.places(torn(seen, asked.torn, lots) if asked.torn else seen)
            for way, ground in places.items():
                found.setdefault(way, []).append(_rows(moment.frame, ground))
            if asked.picture and name == asked.pictured and moment.frame == frames[len(frames) // 2]:
                picture(asked.picture, shown, _standing(one, bench, moment.frame))
    results = {way: judged(one, bench, np.concatenate(rows), list(frames)) for way, rows in found.items()}
    model, data = (results[f"{way}, C {KERNELS[1]:.2f}"].distance for way in (_MODEL, _DATA))
    both = model.keys() & data.keys()
    for way, result in results.items():
        yield f"| {name} | {way} | {_cells(result, both)} | {_milliseconds(way, ways.seconds)} |"
    yield f"{name}: {len(frames)} frames, {results['pass'].people} person-frames, {len(both)} in `same`"


def _cells(result: Judged, both: set[tuple[int, int]]) -> str:
    same = [result.distance[key] for key in both if key in result.distance]
    hits, error = len(result.distance), np.array(list(result.distance.values()))
    numbers = f"{hits} | {result.people - hits} | {result.found - hits}"
    mean = f"{error.mean():.3f} | {np.median(error):.3f}" if hits else " | "
    return f"{mean} | {np.mean(same):.3f} | {numbers}" if same else f"{mean} |  | {numbers}"


def _milliseconds(way: str, seconds: dict[str, list[float]]) -> str:
    """Of a frame, that first one left out in which kernels are compiled or loaded."""
    names = [name for name in (way.partition(",")[0], way) if name in seconds and not name.startswith("pass")]
    names = names or [way]
    return f"{1e3 * sum(float(np.mean(seconds[name][1:])) for name in names):.1f}"


def _recording(name: str, bench: Bench) -> tuple[ResultSet, Recording]:
    base, _, views = name.partition(":")
    recording = prepared(SETS[base], bench)
    return SETS[base], some_views(recording, int(views)) if views else recording


def _rows(frame: int, ground: Floats) -> Rows:
    rows = np.zeros(len(ground), TRAJECTORY)
    rows["frame"], rows["id"] = frame, np.arange(len(ground))
    rows["x"], rows["y"] = ground.T
    return rows


def _standing(one: ResultSet, bench: Bench, frame: int) -> Floats:
    assert one.truth is not None
    truth = read_tracks_csv(bench.path(one.truth))
    own = truth[truth["frame"] == frame]
    return np.column_stack([own["x"], own["y"]])


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    sets = ["uu4", "easy", "dense4", "dense4:3", "cmc1", "wildtrack"]
    parser.add_argument("--sets", type=lambda text: text.split(","), default=sets)
    parser.add_argument("--every", type=int, default=5, help="of so many frames one is taken")
    parser.add_argument("--least", type=int, default=20, help="frames of each set at least")
    parser.add_argument("--set", action="append", default=[], help="detection.level=0.08, or any other constant")
    parser.add_argument("--torn", type=float, default=0.0, help="share of every map that is erased")
    parser.add_argument("--picture", type=Path, help="where to draw the maps of one frame")
    parser.add_argument("--pictured", default="easy", help="of which set")
    parser.add_argument("--data", type=Path, default=ROOT / "../shared/data")
    parser.add_argument("--work", type=Path, default=ROOT / "build/results")
    asked = parser.parse_args(arguments)
    bench = Bench(asked.data.resolve(), asked.work.resolve())
    print("| set | way | error, mean m | median | same | found | missed | extra | ms a frame |")
    print("| --- | --- | --: | --: | --: | --: | --: | --: | --: |")
    for name in asked.sets:
        print("\n".join(measured(name, bench, asked)), flush=True)


if __name__ == "__main__":
    main()
