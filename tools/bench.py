"""CPU time of fixed workloads, for this checkout and another one side by side.

    python tools/bench.py --work FOLDER                      all workloads, one row each
    python tools/bench.py --work FOLDER --base OTHER         the same for another checkout, at the same time
    python tools/bench.py --work FOLDER --record             append the rows to docs/results/speed.csv
    python tools/bench.py --work FOLDER --check              the smallest workload beside a stored commit (CI)

A workload is `stseg run` with one worker on a simulated recording. Its cost is the CPU time of the process and its
children; what starting costs is measured by a run of fewer frames and taken off. Figures are milliseconds a frame set.
Machines and their load differ by more than a change does, so checkouts that are compared run at the same time. A check
compares with the commit of the last stored row. `start` is the CPU time until the first frames are out.
"""

import csv
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

import numpy as np
from workbench import ROOT, checkout, command_line, commit

from stseg.arrays import Floats
from stseg.io.outputs.simulated_scene import write_scene
from stseg.simulation import NAMED, SceneFilm, SceneSpec

TABLE = ROOT / "docs" / "results" / "speed.csv"
_GREATEST_LOSS = 1.1
"""Ratio of the cost to that of the stored commit, at which a check fails."""
_LEAST_ROUNDS, _MOST_ROUNDS = 3, 6
"""Rounds after which a check may pass, and after which it fails."""
RUN = "import sys; from stseg.commands.main import main; sys.exit(main())"


@dataclass(frozen=True)
class Workload:
    """What is simulated, the rig file of its video, masks or boxes, and the frames of two runs whose difference is the
    cost; without `many` the cost is that of the first."""

    name: str
    scene: SceneSpec
    rig: str
    few: int
    many: int | None


def workloads() -> list[Workload]:
    """All workloads, the smallest first."""
    small = replace(NAMED["easy"], seconds=24.0, size=(360, 288), cameras=2, people=2, seed=7)
    video = replace(NAMED["easy"], seconds=6.0, frame_rate=15.0, size=(720, 576))
    crowd = replace(NAMED["dense"], seconds=4.0, frame_rate=7.5)
    plaza = replace(NAMED["easy"], area=(20.0, 20.0), camera_distance=16.0, cameras=7, people=10, seconds=6.0, seed=8)
    square = replace(NAMED["plaza"], area=(29.0, 37.0), camera_distance=30.0, people=35, seconds=3.0, stay=60.0)
    return [
        Workload("small", small, "rig.toml", 10, 240),
        Workload("video", video, "rig.toml", 30, 90),
        Workload("boxes", crowd, "rig_boxes.toml", 10, 30),
        Workload("masks", crowd, "rig_masks.toml", 10, 30),
        Workload("plaza", plaza, "rig_masks.toml", 20, 50),
        Workload("crowd", square, "rig_masks.toml", 5, 15),
        Workload("start", small, "rig.toml", 2, None),
    ]


def cpu_of_runs(sources: Sequence[Path], rig: Path, output: Path, frames: int) -> Floats:
    """CPU seconds of `stseg run` of the first frames, by the code of each checkout, float64 (checkout)."""
    words = ["run", str(rig), "--frames", f"0:{frames}", "--overwrite", "--workers", "1", "-o"]
    running = [
        subprocess.Popen(
            [sys.executable, "-P", "-c", RUN, *words, f"{output}_{number}.h5"],
            env=os.environ | {"PYTHONPATH": str(source)},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
        )
        for number, source in enumerate(sources)
    ]
    cpu = []
    for source, process in zip(sources, running, strict=True):
        assert process.stderr is not None
        messages = process.stderr.read().decode()
        _, status, usage = os.wait4(process.pid, 0)
        if status:
            sys.exit(f"stseg {' '.join(words)} by {source}:\n{messages}")
        cpu.append(usage.ru_utime + usage.ru_stime)
    return np.array(cpu)


def costs(workload: Workload, sources: Sequence[Path], work: Path) -> Iterator[Floats]:
    """Milliseconds a frame set by each checkout (of `start`, of the whole run), in rounds without end."""
    rig, output = work / workload.name / workload.rig, work / workload.name
    if not rig.exists():
        write_scene(rig.parent, SceneFilm(workload.scene), overwrite=True)
    cpu_of_runs(sources, rig, output, workload.many or workload.few)  # compiles what is not in the cache
    while True:
        cost = cpu_of_runs(sources, rig, output, workload.few)
        if workload.many is not None:
            cost = (cpu_of_runs(sources, rig, output, workload.many) - cost) / (workload.many - workload.few)
        yield 1000 * cost


def stored_commit(name: str) -> str:
    """The commit of the last row that the table holds of a workload."""
    with TABLE.open(newline="") as file:
        return [row["commit"] for row in csv.DictReader(file) if row["workload"] == name][-1]


def record(rows: Sequence[tuple[str, float]]) -> None:
    """Append names and milliseconds of workloads to the table, under this commit."""
    with TABLE.open("a", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([commit(), name, f"{taken:.1f}"] for name, taken in rows)


def main() -> None:
    """Measure, print, and record or check."""
    parser = command_line(__doc__)
    parser.add_argument("--base", type=Path, help="another checkout to compare with")
    parser.add_argument("--workloads", default="", help="names, by comma; all if not given")
    parser.add_argument("--rounds", type=int, default=4, help="repetitions, of which the median counts")
    parser.add_argument("--record", action="store_true", help="append the rows to the table")
    parser.add_argument("--check", action="store_true", help="fail where the smallest workload has become slower")
    asked = parser.parse_args()
    asked.work.mkdir(parents=True, exist_ok=True)
    if asked.check:
        check(asked.work)
        return
    names = [name for name in asked.workloads.split(",") if name]
    checkouts = [ROOT] if asked.base is None else [ROOT, asked.base.resolve()]
    rows = []
    beside = "" if asked.base is None else f" {'base':>8} {'gain':>6}"
    print(f"{'workload':10} {'ms/frame set':>12}{beside}")
    for workload in workloads():
        if names and workload.name not in names:
            continue
        taken = np.median([*islice(costs(workload, checkouts, asked.work), asked.rounds)], axis=0)
        rows.append((workload.name, float(taken[0])))
        beside = "" if asked.base is None else f" {taken[1]:8.1f} {taken[1] / taken[0]:6.2f}"
        print(f"{workload.name:10} {taken[0]:12.1f}{beside}", flush=True)
    if asked.record:
        record(rows)


def check(work: Path) -> None:
    """End with an error where the smallest workload lost more than is allowed beside the stored commit."""
    small = workloads()[0]
    base = checkout(stored_commit(small.name), work)
    total = np.zeros(2)
    for number, taken in enumerate(islice(costs(small, [ROOT, base], work), _MOST_ROUNDS), start=1):
        total += taken
        ratio = total[0] / total[1]
        print(f"small: {taken[0]:.1f} ms a frame set, {taken[1]:.1f} by {base.name}, ratio {ratio:.2f}", flush=True)
        if number >= _LEAST_ROUNDS and ratio <= _GREATEST_LOSS:
            return
    sys.exit(f"small: {ratio:.2f} times the cost of {base.name}, expected at most {_GREATEST_LOSS}")


if __name__ == "__main__":
    main()
