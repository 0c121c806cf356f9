"""What each part is worth: measure without it, and write docs/ablation.md.

    python tools/ablation.py [--data ../shared/data] [--sets uu4,cmc1,...] [--parts views,smoothness]
        [--ways threshold,cut,...] [--work FOLDER]

`views` runs every way of tools/ablation_ways.py on two, three and four views of each set (on all views of `wildtrack`
and `dense_boxes`, of which there are more), `smoothness` the whole way at half, once and twice the default
`segmentation.smoothness`. Figures go to docs/ablation.json, each row replacing the same row of an earlier run, and from
there into the marked parts of docs/ablation.md. `--sets none` writes the page anew.

Rendered scenes in WORK are used again: remove WORK after a change to the simulator.
"""

from __future__ import annotations

import argparse
import json
import shlex
import subprocess
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from ablation_page import rewrite
from ablation_ways import WAYS, follow, some_views, threshold
from result_sets import SETS, ResultSet
from results import ROOT, Bench

from stseg.arrays import Rows
from stseg.config import Config
from stseg.evaluation import evaluate
from stseg.evaluation.scores import Scores
from stseg.evaluation.sequence import Area
from stseg.io.recording.recording import Recording
from stseg.io.recording.rigs import read_rig
from stseg.io.track_csv import read_tracks_csv

SCENES = ("crossing", "meeting", "meeting_heights", "border")
MEASURED = {
    "views": ("uu4", "cmc1", "cmc2", "wildtrack", "dense_boxes", *(f"{scene}_boxes" for scene in SCENES), *SCENES),
    "smoothness": ("uu4", "cmc2", "wildtrack"),
}
FACTORS = (0.5, 1.0, 2.0)
_ALL_VIEWS = ("wildtrack", "dense_boxes", *SCENES)
"""Sets that are run on all of their views alone: a crowd's, where fewer do not do, and those rendered in colour."""

Row = dict[str, Any]


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure what is asked for, then write the page."""
    options = _options(arguments)
    bench = Bench(options.data.resolve(), options.work.resolve())
    for part in options.parts:
        for one in (SETS[name] for name in MEASURED[part] if name in options.sets):
            taken = one, prepared(one, bench), bench
            for row in _views(*taken, options.ways) if part == "views" else _smoothness(*taken):
                publish([{"part": part, "set": one.name, "commit": _commit(), **row}])
    publish([])


def publish(rows: list[Row]) -> None:
    """Put rows among the figures, and write the page anew from all of them."""
    store, page = ROOT / "docs" / "ablation.json", ROOT / "docs" / "ablation.md"
    figures: list[Row] = json.loads(store.read_text(encoding="utf-8"))
    kept = {_key(row): row for row in [*figures, *rows]}
    store.write_text(json.dumps([kept[key] for key in sorted(kept)], indent=1) + "\n", encoding="utf-8")
    page.write_text(rewrite(page.read_text(encoding="utf-8"), list(kept.values())), encoding="utf-8")
    for row in rows:
        print(_key(row), {name: row["finished"][name] for name in ("MODA", "IDF1", "IDSW")}, flush=True)


def _key(row: Row) -> tuple[str, str, int, str, float]:
    return row["part"], row["set"], row["views"], row["way"], row.get("smoothness", 0.0)


def _views(one: ResultSet, recording: Recording, bench: Bench, ways: Sequence[str]) -> Iterator[Row]:
    """The ways on some of the views."""
    first, stop = frames_of(one)
    for number in (len(recording.sources),) if one.name in _ALL_VIEWS else (4, 3, 2):
        part = some_views(recording, number)
        for way in ways:
            row: Row = {"views": number, "way": way}
            if way == "threshold":
                tried = {level: score(one, rows, bench) for level, rows in threshold(part, first, stop).items()}
                row["level"] = max(tried, key=lambda level: _f1(tried[level]))
                row["committed"] = row["finished"] = tried[row["level"]].as_dict()
            else:
                found = follow(part, first, stop, way, Config())
                row["committed"] = score(one, found.committed, bench).as_dict()
                row["finished"] = score(one, found.finished, bench).as_dict()
            yield row


def _f1(scores: Scores) -> float:
    """Harmonic mean of precision and recall; MODA would be best where nobody is found at all."""
    return 2 * scores.hits / max(scores.truths + scores.detections, 1)


def _smoothness(one: ResultSet, recording: Recording, bench: Bench) -> Iterator[Row]:
    """The whole way at half, once and twice the default smoothness."""
    default = Config()
    for factor in FACTORS:
        value = factor * default.segmentation.smoothness
        config = replace(default, segmentation=replace(default.segmentation, smoothness=value))
        found = follow(recording, *frames_of(one), "cut", config)
        scores = score(one, found.finished, bench).as_dict()
        yield {"views": len(recording.sources), "way": "cut", "smoothness": value, "finished": scores}


def score(one: ResultSet, rows: Rows, bench: Bench) -> Scores:
    """Scores of tracks as the set is scored in docs/results.md."""
    assert one.truth is not None
    truth, frames = read_tracks_csv(bench.path(one.truth)), np.arange(*frames_of(one))
    flagged = "--ignore-flagged" in shlex.split(one.scoring)
    return evaluate(truth, rows, area=area_of(one), frames=frames, ignore_flagged=flagged)


def area_of(one: ResultSet) -> Area | None:
    """The rectangle that counts, None for all."""
    for option in shlex.split(one.scoring):
        if option.startswith("--area="):
            x0, y0, x1, y1 = map(float, option.partition("=")[2].split(","))
            return x0, y0, x1, y1
    return None


def prepared(one: ResultSet, bench: Bench) -> Recording:
    """The set's recording; its rig and truth are made."""
    bench.work.mkdir(parents=True, exist_ok=True)
    if one.film is not None and not bench.path(one.rig).exists():
        bench.do(f"{one.film} --overwrite")
    for command in one.prepare:
        bench.do(command)
    return read_rig(bench.path(one.rig))


def frames_of(one: ResultSet) -> tuple[int, int]:
    first, _, stop = (one.peer_frames or one.frames).partition(":")
    return int(first), int(stop)


def _commit() -> str:
    command = ["git", "rev-parse", "--short", "HEAD"]
    return subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True).stdout.strip()


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=ROOT / "../shared/data")
    parser.add_argument("--work", type=Path, default=ROOT / "build/results")
    parser.add_argument("--sets", type=lambda text: text.split(","), default=list(SETS), help="names of sets, or none")
    parser.add_argument("--parts", type=lambda text: text.split(","), default=list(MEASURED), help="views, smoothness")
    parser.add_argument("--ways", type=lambda text: text.split(","), default=list(WAYS), help=", ".join(WAYS))
    return parser.parse_args(arguments)


if __name__ == "__main__":
    main()
