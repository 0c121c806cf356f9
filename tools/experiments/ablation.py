"""What each special case earns: perturbed runs (tools/measure.py) with one of them off at a time.

    python tools/experiment.py ablation [--sets laboratory,cmc2] [--mechanisms "rim,key frames"] [--runs 4] [--jobs 2]

A line is the mean change of the scores where a mechanism is off, with the standard error of the mean: each run is
compared with the run of the same perturbation with everything on. Lines of other sets and mechanisms stay.
"""

import csv
from collections.abc import Sequence
from dataclasses import replace
from typing import Any
from unittest.mock import patch

import numpy as np
from measure import Tracked, final_rows, prepare, scored, tracked
from result_sets import SETS, ResultSet
from workbench import Bench, command_line, commit, in_processes, write_table

from stseg.config import Config
from stseg.detection.search.frame_search import FrameSearch
from stseg.records.tables import EVENT
from stseg.trackers.window_existence import TrackedFrame

_DETECTOR, _SEARCH = "stseg.detection.detector", "stseg.detection.search.frame_search"
_FINAL, _OBSERVED = "stseg.trajectories.final_tracks", "stseg.identities.evidence.observations"
_NO_EVENTS = np.zeros(0, EVENT)


def _unrevised(_: object, frames: Sequence[TrackedFrame], first: int, stop: int) -> list[TrackedFrame]:
    return [one for one in frames if first <= one.fused.frame < stop]


WHOLE: dict[str, tuple[str, Any]] = {
    "restart": (f"{_SEARCH}.restarted", lambda estimate, *_: estimate),
    "searched afresh": (f"{_DETECTOR}.weak_members", lambda _: ()),
    "alternatives": (f"{_DETECTOR}.found_alternative", lambda *_: None),
    "merging": (f"{_SEARCH}.merged", lambda estimate, *_: estimate),
    "fitted alternatives": (f"{_SEARCH}._fitted", lambda estimate, others: estimate.pool.at(others[:0])),
    "swaps": (f"{_DETECTOR}.FrameSearch", lambda a, b, c, _, d: FrameSearch(a, b, c, 0, d)),
    "key frames": (f"{_DETECTOR}.key_frame_interval", lambda *_: 1),
    "rim": ("stseg.noise.rim_estimate.RimEstimate.applied", lambda _, views: list(views)),
    "blob scale": ("stseg.detection.frame_evidence.blob_scales", lambda rasters, *_: np.zeros_like(rasters)),
    "hard core": (f"{_DETECTOR}.CORE_MARGIN", 0.3),
    "window existence": ("stseg.trackers.window_existence.WindowExistence.revised", _unrevised),
    "noise of boxes": ("stseg.noise.box_noise_estimate.BoxNoiseEstimate.learn", lambda *_: None),
    "missing boxes": ("stseg.noise.box_noise_estimate.BoxNoiseEstimate.miss_rate", lambda _, first: first),
    "bias of boxes": ("stseg.noise.box_bias_estimate.BoxBiasEstimate.learn", lambda *_: None),
    "population": ("stseg.noise.population_estimate.PopulationEstimate.learn", lambda *_: None),
    "rims of the first frame": (f"{_DETECTOR}.Detector._learn_first_rims", lambda *_: None),
    "tentative tracks": ("stseg.tracking.filter.track_filter.tentative_log_odds", lambda *_: {}),
}
"""Mechanisms of whole runs: what is patched, and with what."""
FINAL: dict[str, tuple[str, Any]] = {
    "certain rows": (f"{_OBSERVED}._certain", lambda rows, *_: np.zeros(len(rows), bool)),
    "short tracks dropped": (f"{_FINAL}.drop_short", lambda rows, *_: (np.unique(rows["id"]), _NO_EVENTS)),
    "short gaps filled": (f"{_FINAL}.interpolated_rows", lambda rows, *_: rows[:0]),
    "encounters": ("stseg.tracking.row_groups._meetings", lambda rows, _: (rows["id"][:0], rows["frame"][:0])),
    "last smoothing": (f"{_FINAL}.smooth_places", lambda *_: None),
}
"""The same of final tracks, which are found again from the rows of one run."""


def _simulated(name: str, rig: str, options: str) -> ResultSet:
    """Ten seconds of a simulated scene."""
    film, folder = f"stseg simulate $WORK/{name} {options} --seconds 10 --frame-rate 10", f"$WORK/{name}"
    one = replace(SETS["dense4"], name=name, film=film, rig=f"{folder}/{rig}.toml", truth=f"{folder}/truth.csv")
    return replace(one, frames="0:100")


_PAIR = SETS["uu4"].prepare[0].replace("cam?/config.xml", "cam1/config.xml $DATA/uu4/cam3/config.xml")
_CROWD = "--scene dense4 --size 320,240"
_FAR = "--scene plaza --people 12 --cameras 4 --size 640,480"
CUTS = {
    "laboratory": replace(SETS["laboratory"], frames="0:250"),
    "cmc2": SETS["cmc2"],
    "wildtrack": replace(SETS["wildtrack"], frames="0:40"),
    "uu4_pair": replace(SETS["uu4"], rig="$WORK/uu4_pair.toml", prepare=(_PAIR.replace("uu4.toml", "uu4_pair.toml"),)),
    "dense4": replace(SETS["dense4"], frames="0:100"),
    "spoiled_masks": _simulated("spoiled", "rig_masks", f"{_CROWD} --spoil erosion --spoil legs --spoil holes"),
    "spoiled_boxes": _simulated("doubled", "rig_boxes", f"{_CROWD} --spoil doubled --spoil jitter --spoil missed"),
    "children": _simulated("children", "rig_masks", "--scene school --size 320,240"),
    "wide": _simulated("wide", "rig_masks", "--scene plaza"),
    "missed": _simulated("missed", "rig_boxes", f"{_FAR} --spoil jitter --spoil missed"),
}
"""The sets, some of them short."""


def _scores(one: ResultSet, bench: Bench, whole: Tracked) -> list[float]:
    found = scored(one, bench, final_rows(whole))
    return [found.moda or 0.0, found.idf1, found.switches]


def run(name: str, bench: Bench, mechanisms: list[str], seed: int) -> list[list[float]]:
    """MODA, IDF1 and switches of one perturbed run, then of the same with each mechanism off."""
    one, config = CUTS[name], Config()
    whole = tracked(one, bench, config, seed)
    found = [_scores(one, bench, whole)]
    for mechanism in mechanisms:
        with patch(*(WHOLE | FINAL)[mechanism]):
            found.append(_scores(one, bench, tracked(one, bench, config, seed) if mechanism in WHOLE else whole))
    return found


def main() -> None:
    """Measure, set by set."""
    parser = command_line(__doc__, runs=4, jobs=2)
    parser.add_argument("--sets", default=",".join(CUTS))
    parser.add_argument("--mechanisms", default=",".join(WHOLE | FINAL))
    asked = parser.parse_args()
    bench, mechanisms = Bench.of(asked), asked.mechanisms.split(",")
    table = asked.output / "ablation.csv"
    lines = {tuple(line[:2]): line for line in csv.reader(table.open())} if table.exists() else {}
    lines["mechanism", "set"] = ["mechanism", "set", "runs", "moda", "idf1", "switches", "commit"]
    for name in asked.sets.split(","):
        prepare(CUTS[name], bench)
        seeds, found = range(1, asked.runs + 1), []
        for scores in in_processes(run, [(name, bench, mechanisms, seed) for seed in seeds], asked.jobs):
            found.append(scores)
            print(name, len(found), scores, flush=True)
        change = np.array(found)[:, 1:] - np.array(found)[:, :1]
        mean, error = change.mean(0), change.std(0, ddof=1) / np.sqrt(asked.runs)
        for k, mechanism in enumerate(mechanisms):
            cells = [f"{m:+.2f} ± {e:.2f}" for m, e in zip(mean[k], error[k], strict=True)]
            lines[mechanism, name] = [mechanism, name, str(asked.runs), *cells, commit()]
        write_table(table, lines.values())
