"""Measure stseg on every set at hand and write docs/results.md.

    python tools/results.py [--data ../shared/data] [--sets uu4,cmc1,...] [--ways cut,kalman,...] [--frames A:B]
        [--work FOLDER] [--no-pictures]

Makes rig files, runs, scores and draws, all through the command line of `stseg`. Figures go to docs/results.json, each
row replacing the same row of an earlier run, and from there into the marked parts of docs/results.md. `--sets none`
writes the page anew from the figures that there are. Ways are the trackers, and the ablations of their papers
(tools/result_ways.py); a set is followed in those of them that its foreground allows. `--frames` measures a part of the
frames, and the row says so.

Times are of the processor: those of the run file's /timings, which are of the wall, by the share of the wall time in
which the run had a processor.

Pictures are written under WORK/pictures and hold images of people; run files and rendered scenes stay in WORK.
Rendered scenes are used again: remove WORK after a change to the simulator.
"""

from __future__ import annotations

import argparse
import datetime
import json
import resource
import shlex
import subprocess
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from result_page import rewrite
from result_pictures import draw, worst_frames
from result_sets import SETS, ResultSet
from result_ways import WAYS, Way

from stseg import __version__
from stseg.io.runfile.runs import Run, read_run
from stseg.io.track_csv import read_tracks_csv

ROOT = Path(__file__).parents[1]
_PROGRAMS = {
    "stseg": [sys.executable, "-c", "import sys; from stseg.commands.main import main; sys.exit(main())"],
    "python": [sys.executable],
}
_WARM_UP = 16  # frames


@dataclass(frozen=True)
class Bench:
    """Where data lie and where results go; runs commands written with $DATA and $WORK."""

    data: Path
    work: Path

    def path(self, text: str) -> Path:
        """A path written with $DATA or $WORK."""
        return Path(self._filled(text))

    def do(self, command: str) -> str:
        """Run a command and return what it printed; stop where it fails."""
        print(f"$ {command}", flush=True)
        program, *arguments = shlex.split(command)
        words = [*_PROGRAMS[program], *(word for argument in arguments for word in self._words(argument))]
        process = subprocess.run(words, stdout=subprocess.PIPE, text=True, cwd=ROOT, check=False)
        if process.returncode:
            sys.exit(f"results.py: exit status {process.returncode} of: {command}")
        return process.stdout

    def _filled(self, text: str) -> str:
        return text.replace("$DATA", str(self.data)).replace("$WORK", str(self.work))

    def _words(self, argument: str) -> list[str]:
        """What a shell would make of an argument."""
        filled = self._filled(argument)
        if "?" not in argument:
            return [filled]
        return sorted(str(path) for path in Path("/").glob(filled.lstrip("/"))) or [filled]


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure the sets that are asked for, then write the page."""
    options = _options(arguments)
    bench = Bench(options.data.resolve(), options.work.resolve())
    warm: set[tuple[str, str]] = set()
    for name in options.sets:
        one = SETS[name] if options.frames is None else replace(SETS[name], frames=options.frames, peer_frames=None)
        ways = [way for way in one.ways if way.name in options.ways]
        _prepare(one, bench)
        for way in ways:
            if (one.foreground, way.tracker) not in warm:
                warm.add((one.foreground, way.tracker))
                _warm_up(one, bench, way)
            row = measure(one, bench, way)
            if options.pictures:
                _draw(one, bench, way, row.get("worst_frames", []))
            publish({f"{name} {way.name}": row})
    publish({})


def publish(rows: dict[str, dict[str, Any]]) -> None:
    """Put rows among the figures, and write the page anew from all of them."""
    store, page = ROOT / "docs" / "results.json", ROOT / "docs" / "results.md"
    figures = json.loads(store.read_text(encoding="utf-8")) | rows
    text = rewrite(page.read_text(encoding="utf-8"), figures)
    store.write_text(json.dumps(dict(sorted(figures.items())), indent=1) + "\n", encoding="utf-8")
    page.write_text(text, encoding="utf-8")
    print(f"wrote {page.relative_to(ROOT)}: {', '.join(rows) or 'no new row'}")


def measure(one: ResultSet, bench: Bench, way: Way) -> dict[str, Any]:
    """Run and score one row; what docs/results.json holds of it."""
    command = one.run_command(way)
    begin = perf_counter(), _processor_seconds()
    bench.do(f"{command} --overwrite")
    share = (_processor_seconds() - begin[1]) / (perf_counter() - begin[0])
    run = read_run(bench.path(one.run_file(way)))
    row: dict[str, Any] = {
        "set": one.name,
        "way": way.name,
        "frames": one.frames,
        "version": __version__,
        "commit": _commit(),
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "milliseconds": _milliseconds(run, share),
        "tracks": len(run.tracks),
        "people_a_frame": round(len(run.trajectory) / len(run.frames), 2),
        "run": command,
    }
    if one.truth is not None:
        row["evaluate"] = one.score_command(way)
        row["scores"] = json.loads(bench.do(f"{row['evaluate']} --json"))
        if one.peer_frames is not None:
            row["peer_scores"] = json.loads(bench.do(f"{one.score_command(way, one.peer_frames)} --json"))
        truth = read_tracks_csv(bench.path(one.truth))
        row["worst_frames"] = worst_frames(run, truth, row["scores"], "--ignore" in one.scoring)
    return row


def _processor_seconds() -> float:
    """Of all commands until now."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _milliseconds(run: Run, share: float) -> dict[str, float]:
    """What each stage took a frame of a run that had a processor for a share of its time."""
    stages, which = np.unique(run.timings["stage"], return_inverse=True)
    seconds = np.bincount(which, run.timings["seconds"], len(stages))
    return {
        stage.decode(): round(1000 * share * took / len(run.frames), 2)
        for stage, took in zip(stages.tolist(), seconds.tolist(), strict=True)
    }


def _commit() -> str:
    command = ["git", "rev-parse", "--short", "HEAD"]
    return subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True).stdout.strip()


def _prepare(one: ResultSet, bench: Bench) -> None:
    """Rig and truth."""
    bench.work.mkdir(parents=True, exist_ok=True)
    if one.film is not None and not bench.path(one.rig).exists():
        bench.do(f"{one.film} --overwrite")
    for command in one.prepare:
        bench.do(command)


def _warm_up(one: ResultSet, bench: Bench, way: Way) -> None:
    """A short run, so that no row's time holds the compiling of kernels."""
    first = int(one.frames.partition(":")[0])
    part = f"--frames {first}:{first + _WARM_UP}"
    bench.do(f"stseg run {one.rig} -o $WORK/warm_up.h5 {part} --tracker {way.tracker} --overwrite")


def _draw(one: ResultSet, bench: Bench, way: Way, frames: Sequence[int]) -> None:
    """The report with its pictures, and the ground at each of the worst frames."""
    folder = f"$WORK/pictures/{one.name}_{way.name}"
    bench.path(folder).mkdir(parents=True, exist_ok=True)
    truth = "" if one.truth is None else f" --truth {one.truth}"
    shown = "".join(f" --frame {frame}" for frame in frames)
    bench.do(
        f"stseg report {one.run_file(way)} -o {folder}/report.html --pictures {folder}{truth}{shown} "
        "--camera-images --overwrite"
    )
    if one.truth is not None:
        run, true = read_run(bench.path(one.run_file(way))), read_tracks_csv(bench.path(one.truth))
        draw(run, true, frames, bench.path(folder))


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=ROOT / "../shared/data")
    parser.add_argument("--work", type=Path, default=ROOT / "build/results")
    parser.add_argument("--sets", type=_names, default=list(SETS), help="names of sets; none for the page alone")
    parser.add_argument("--ways", type=_ways, default=list(WAYS), help=f"of {', '.join(WAYS)}")
    parser.add_argument("--frames", help="A:B, half open; else all that the set's row is of")
    parser.add_argument("--no-pictures", dest="pictures", action="store_false")
    return parser.parse_args(arguments)


def _names(text: str) -> list[str]:
    return [] if text == "none" else _known(text, SETS, ", or none")


def _ways(text: str) -> list[str]:
    return _known(text, WAYS)


def _known(text: str, known: Iterable[str], otherwise: str = "") -> list[str]:
    names, known = text.split(","), tuple(known)
    unknown = [name for name in names if name not in known]
    if unknown:
        raise argparse.ArgumentTypeError(f"{', '.join(unknown)}: expected names among {', '.join(known)}{otherwise}")
    return names


if __name__ == "__main__":
    main()
