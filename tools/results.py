"""Measure stseg on every set at hand: docs/results.json, and docs/development/measurements.md from it.

    python tools/results.py [--sets uu4,cmc1,...] [--variants cut,kalman,...] [--frames A:B] [--perturbed 8] [--jobs 2]
        [--data ../shared/data] [--work FOLDER] [--no-times] [--pictures]
    python tools/results.py --all        every set and tracker, unattended, from an empty table

Makes rig files, runs and scores, all through the command line of `stseg`. A row replaces the same row of an earlier
run; `--all` deletes all others first, so that every figure is of one commit. `--sets none` writes the page
from the stored figures. Variants are the trackers and the ablations of their papers (tools/result_variants.py); a set
is tracked by those that its foreground allows. `--frames` measures a part of the frames, and the row says so.

Times are of the processor: those of the run file's /timings, which are of the wall, by the share of the wall time in
which the run had a processor. With --no-times rows have none, and --jobs of them are measured at once.

`--perturbed N` adds the mean and the standard deviation over N more runs of `cut` and `frames`, each on evidence of
which random boxes, or frames of a view, are missing: 1 in 200. Crowds are chaotic; one run says little of them.

Rendered scenes in WORK are used again: remove WORK after a change to the simulator. Pictures (--pictures) hold images
of people; they stay in WORK.
"""

from __future__ import annotations

import argparse
import datetime
import json
import resource
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from measure import prepare, prepared, score, track
from result_page import MAIN, page
from result_pictures import draw, worst_frames
from result_sets import SETS, ResultSet
from result_variants import VARIANTS, Variant
from workbench import ROOT, Bench, commit

from stseg.io.config_file import read_config
from stseg.io.runfile.runs import Run, read_run
from stseg.io.track_csv import read_tracks_csv
from stseg.version import __version__

STORE, PAGE = ROOT / "docs" / "results.json", ROOT / "docs" / "development" / "measurements.md"
SPREAD = ("MODA", "IDF1", "MOTA", "IDSW")
"""Scores of which perturbed runs give mean and standard deviation."""
_WARM_UP = 16  # frames


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure the sets that are asked for, then write the page."""
    options = _options(arguments)
    bench = Bench(options.data.resolve(), options.work.resolve())
    if options.all:
        STORE.write_text("{}\n", encoding="utf-8")
    sets = [SETS[name] if options.frames is None else _part(SETS[name], options.frames) for name in options.sets]
    for one in sets:
        prepare(one, bench)
        variants = [variant for variant in one.variants if variant.name in options.variants]
        for variant, row in _rows(one, variants, bench, options):
            if options.perturbed and one.truth is not None and variant in MAIN:
                row["perturbed"] = spread(one, bench, variant, options.perturbed, options.jobs)
            if options.pictures:
                _draw(one, bench, variant, row.get("worst_frames", []))
            publish({f"{one.name} {variant.name}": row})
    publish({})


def publish(rows: dict[str, dict[str, Any]]) -> None:
    """Put rows among the figures, and write the page from all of them."""
    figures = json.loads(STORE.read_text(encoding="utf-8")) | rows
    PAGE.parent.mkdir(exist_ok=True)
    PAGE.write_text(page(figures), encoding="utf-8")
    STORE.write_text(json.dumps(dict(sorted(figures.items())), indent=1) + "\n", encoding="utf-8")
    print(f"wrote {PAGE.relative_to(ROOT)}: {', '.join(rows) or 'no new row'}", flush=True)


def _rows(
    one: ResultSet, variants: Sequence[Variant], bench: Bench, options: argparse.Namespace
) -> Iterable[tuple[Variant, dict[str, Any]]]:
    """The rows of a set: one after the other where they are timed."""
    if options.times:
        for variant in variants:
            _warm_up(one, bench, variant)
            yield variant, measure(one, bench, variant, True)
    else:
        with ThreadPoolExecutor(options.jobs) as pool:
            rows = pool.map(lambda variant: measure(one, bench, variant, False), variants)
            yield from zip(variants, rows, strict=True)


def measure(one: ResultSet, bench: Bench, variant: Variant, timed: bool) -> dict[str, Any]:
    """Run and score one row of docs/results.json."""
    command = one.run_command(variant)
    begin = perf_counter(), _processor_seconds()
    bench.do(f"{command} --overwrite")
    share = (_processor_seconds() - begin[1]) / (perf_counter() - begin[0])
    run = read_run(bench.path(one.run_file(variant)))
    row: dict[str, Any] = {
        "set": one.name,
        "variant": variant.name,
        "frames": one.frames,
        "version": __version__,
        "commit": commit(),
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "milliseconds": _milliseconds(run, share) if timed else {},
        "tracks": len(run.tracks),
        "people_a_frame": round(len(run.trajectory) / len(run.frames), 2),
        "run": command,
    }
    if one.truth is not None:
        row["evaluate"] = one.score_command(variant)
        row["scores"] = json.loads(bench.do(f"{row['evaluate']} --json"))
        if one.peer_frames is not None:
            row["peer_scores"] = json.loads(bench.do(f"{one.score_command(variant, one.peer_frames)} --json"))
        truth = read_tracks_csv(bench.path(one.truth))
        row["worst_frames"] = worst_frames(run, truth, row["scores"], "--ignore" in one.scoring)
    return row


def spread(one: ResultSet, bench: Bench, variant: Variant, runs: int, jobs: int) -> dict[str, Any]:
    """Mean and standard deviation of scores over perturbed runs, each in a process of its own."""
    with ProcessPoolExecutor(jobs, get_context("spawn")) as pool:
        scores = list(pool.map(_perturbed, *zip(*[(one, bench, variant, seed) for seed in range(runs)], strict=True)))
    table = np.array([[each[name] for name in SPREAD] for each in scores], float)
    mean, deviation = table.mean(0), table.std(0, ddof=1) if runs > 1 else np.zeros(len(SPREAD))
    pairs = zip(SPREAD, mean.tolist(), deviation.tolist(), strict=True)
    return {"runs": runs} | {name: [round(m, 2), round(d, 2)] for name, m, d in pairs}


def _perturbed(one: ResultSet, bench: Bench, variant: Variant, seed: int) -> dict[str, Any]:
    first, stop = map(int, one.frames.split(":"))
    config = read_config(None, [variant.setting] if variant.setting else [])
    found = track(prepared(replace(one, prepare=()), bench), first, stop, variant.tracker, config, seed)
    return score(one, found.finished, bench, first, stop).as_dict()


def _part(one: ResultSet, frames: str) -> ResultSet:
    return replace(one, frames=frames, peer_frames=None)


def _processor_seconds() -> float:
    """Of all commands until now."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _milliseconds(run: Run, share: float) -> dict[str, float]:
    """Processor time of each stage a frame, in a run that had a processor for a share of its time."""
    stages, which = np.unique(run.timings["stage"], return_inverse=True)
    seconds = np.bincount(which, run.timings["seconds"], len(stages))
    return {
        stage.decode(): round(1000 * share * took / len(run.frames), 2)
        for stage, took in zip(stages.tolist(), seconds.tolist(), strict=True)
    }


def _warm_up(one: ResultSet, bench: Bench, variant: Variant) -> None:
    """A short run, so that no row's time holds the compiling of kernels."""
    first = int(one.frames.partition(":")[0])
    part = f"--frames {first}:{first + _WARM_UP}"
    bench.do(f"stseg run {one.rig} -o $WORK/warm_up.h5 {part} {variant.options} --overwrite")


def _draw(one: ResultSet, bench: Bench, variant: Variant, frames: Sequence[int]) -> None:
    """The report with its pictures, and the ground at each of the worst frames."""
    folder = f"$WORK/pictures/{one.name}_{variant.name}"
    bench.path(folder).mkdir(parents=True, exist_ok=True)
    truth = "" if one.truth is None else f" --truth {one.truth}"
    shown = "".join(f" --frame {frame}" for frame in frames)
    bench.do(
        f"stseg report {one.run_file(variant)} -o {folder}/report.html --pictures {folder}{truth}{shown} "
        "--camera-images --overwrite"
    )
    if one.truth is not None:
        run, true = read_run(bench.path(one.run_file(variant))), read_tracks_csv(bench.path(one.truth))
        draw(run, true, frames, bench.path(folder))


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--all", action="store_true", help="from an empty table; --perturbed 8 if not given")
    parser.add_argument("--data", type=Path, default=ROOT / "../shared/data")
    parser.add_argument("--work", type=Path, default=ROOT / "build/results")
    parser.add_argument("--sets", type=_names, default=list(SETS), help="names of sets; none for the page alone")
    parser.add_argument("--variants", type=_variants, default=list(VARIANTS), help=f"of {', '.join(VARIANTS)}")
    parser.add_argument("--frames", help="A:B, half open; else all frames of a set")
    parser.add_argument("--perturbed", type=int, metavar="N", help="perturbed runs to each row of cut and frames")
    parser.add_argument("--jobs", type=int, default=1, help="perturbed and untimed runs at once")
    parser.add_argument("--no-times", dest="times", action="store_false")
    parser.add_argument("--pictures", action="store_true", help="reports and plans of the worst frames, in WORK")
    options = parser.parse_args(arguments)
    if options.perturbed is None:
        options.perturbed = 8 if options.all else 0
    return options


def _names(text: str) -> list[str]:
    return [] if text == "none" else _known(text, SETS, ", or none")


def _variants(text: str) -> list[str]:
    return _known(text, VARIANTS)


def _known(text: str, known: Iterable[str], otherwise: str = "") -> list[str]:
    names, known = text.split(","), tuple(known)
    unknown = [name for name in names if name not in known]
    if unknown:
        raise argparse.ArgumentTypeError(f"{', '.join(unknown)}: expected names among {', '.join(known)}{otherwise}")
    return names


if __name__ == "__main__":
    main()
