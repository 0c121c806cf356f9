"""CPU time of fixed workloads, for this checkout and another one side by side.

    python tools/bench.py --work FOLDER                      all workloads, one row each
    python tools/bench.py --work FOLDER --base OTHER         the same for another checkout, in turns with this one
    python tools/bench.py --work FOLDER --record             append the rows to docs/results/speed.csv
    python tools/bench.py --work FOLDER --check              the smallest workload against the stored ratio (CI)

A workload is `stseg run` with one worker on a simulated recording. Its cost is the CPU time of the process and its
children; what starting costs is measured by a run of fewer frames and taken off. Figures are milliseconds a frame set,
and the same beside the time of a fixed calibration kernel, which makes machines comparable. Other load slows caches and
clocks for seconds at a time, so the kernel works for seconds, too, before and after each pair of runs, and they are
compared within each round: the median of the rounds counts. A check ends with the first round that is quick enough, or
fails after twenty: load passes, a loss stays. `start` is the CPU time until the first frames are out.
"""

from __future__ import annotations

import csv
import os
import subprocess
import sys
import time
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from workbench import ROOT, command_line, commit

from stseg.io.outputs.simulated_scene import write_scene
from stseg.simulation import NAMED, SceneFilm, SceneSpec

TABLE = ROOT / "docs" / "results" / "speed.csv"
_ALLOWED = 1.25
"""How many times the stored ratio a check may come to."""
_ATTEMPTS = 20
"""How many rounds a check that fails is measured."""
_CALIBRATED = 2.0
"""CPU seconds of a calibration: long enough to meet the load that a run of seconds meets."""
RUN = "import sys; from stseg.commands.main import main; sys.exit(main())"


@dataclass(frozen=True)
class Workload:
    """A recording, and the frames of it that are measured.

    Attributes
    ----------
    name
    scene
        What is simulated.
    rig
        The rig file: video, masks or boxes.
    few, many
        Frames of the two runs whose difference is the cost; without `many` the cost is that of the first.
    """

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


def calibration_seconds() -> float:
    """CPU time of fixed scalar work, deflate and a Python loop; the mean of two seconds.

    Not of NumPy's vector kernels: their speed differs by a factor of three between processors that run `stseg` alike.
    """
    content = np.random.default_rng(0).integers(0, 16, 200_000, np.uint8).tobytes()
    start, passes = time.process_time(), 0
    while time.process_time() - start < _CALIBRATED:
        zlib.compress(content, 6)
        sum(k * k % 7 for k in range(50_000))
        passes += 1
    return (time.process_time() - start) / passes


def cpu_of_run(checkout: Path, rig: Path, output: Path, frames: int) -> float:
    """CPU seconds of `stseg run` of the first frames, by the code of a checkout."""
    words = ["run", str(rig), "-o", str(output), "--frames", f"0:{frames}", "--overwrite", "--workers", "1"]
    environment = os.environ | {"PYTHONPATH": str(checkout)}
    process = subprocess.Popen(
        [sys.executable, "-P", "-c", RUN, *words], env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    )
    assert process.stderr is not None
    messages = process.stderr.read().decode()
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        sys.exit(f"stseg {' '.join(words)} by {checkout}:\n{messages}")
    return usage.ru_utime + usage.ru_stime


def measure(workload: Workload, checkouts: Sequence[Path], work: Path, rounds: int) -> tuple[list[float], list[float]]:
    """Milliseconds a frame set by each checkout (of `start`, of the whole run), and the first one's ratio by round."""
    rig, output = work / workload.name / workload.rig, work / f"{workload.name}.h5"
    if not rig.exists():
        write_scene(rig.parent, SceneFilm(workload.scene), overwrite=True)
    for checkout in checkouts:  # compiles what is not in the cache
        cpu_of_run(checkout, rig, output, workload.many or workload.few)
    costs, ratios = [], []
    before = calibration_seconds()
    for k in range(rounds):
        turns = checkouts[:: 1 if k % 2 == 0 else -1]  # who comes second in a pair is favoured
        taken = {checkout: _cost(workload, checkout, rig, output) for checkout in turns}
        costs.append([taken[checkout] for checkout in checkouts])
        after = calibration_seconds()
        ratios.append(costs[-1][0] / (0.5 * (before + after)))
        before = after
    return [1000 * float(cost) for cost in np.median(costs, axis=0)], ratios


def _cost(workload: Workload, checkout: Path, rig: Path, output: Path) -> float:
    """CPU seconds a frame set of a workload; of `start`, of the whole run."""
    few = cpu_of_run(checkout, rig, output, workload.few)
    if workload.many is None:
        return few
    return (cpu_of_run(checkout, rig, output, workload.many) - few) / (workload.many - workload.few)


def stored_ratio(name: str) -> float:
    """The last ratio that the table holds of a workload."""
    with TABLE.open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["workload"] == name]
    return float(rows[-1]["ratio"])


def record(rows: Sequence[tuple[str, float, float]]) -> None:
    """Append name, milliseconds and ratio of workloads to the table, under this commit."""
    new = not TABLE.exists()
    with TABLE.open("a", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        if new:
            writer.writerow(["commit", "workload", "milliseconds", "ratio"])
        writer.writerows([commit(), name, f"{taken:.1f}", f"{ratio:.3f}"] for name, taken, ratio in rows)


def main() -> None:
    """Measure, print, and record or check."""
    parser = command_line(__doc__)
    parser.add_argument("--base", type=Path, help="another checkout to compare with")
    parser.add_argument("--workloads", default="", help="names, by comma; all if not given")
    parser.add_argument("--rounds", type=int, default=4, help="repetitions, of which the median counts")
    parser.add_argument("--record", action="store_true", help="append the rows to the table")
    parser.add_argument("--check", action="store_true", help="fail where the smallest workload lost more than 25 %%")
    asked = parser.parse_args()
    asked.work.mkdir(parents=True, exist_ok=True)
    if asked.check:
        check(asked.work)
        return
    names = [name for name in asked.workloads.split(",") if name]
    checkouts = [ROOT] if asked.base is None else [ROOT, asked.base.resolve()]
    rows = []
    beside = "" if asked.base is None else f" {'base':>8} {'gain':>6}"
    print(f"{'workload':10} {'ms/frame set':>12} {'ratio':>8}{beside}")
    for workload in workloads():
        if names and workload.name not in names:
            continue
        taken, ratios = measure(workload, checkouts, asked.work, asked.rounds)
        ratio = float(np.median(ratios))
        rows.append((workload.name, taken[0], ratio))
        beside = "" if asked.base is None else f" {taken[1]:8.1f} {taken[1] / taken[0]:6.2f}"
        print(f"{workload.name:10} {taken[0]:12.1f} {ratio:8.3f}{beside}", flush=True)
    if asked.record:
        record(rows)


def check(work: Path) -> None:
    """End with an error where the smallest workload lost more than is allowed, in each of several rounds."""
    small, allowed = workloads()[0], _ALLOWED * stored_ratio("small")
    for _ in range(_ATTEMPTS):
        taken, ratios = measure(small, [ROOT], work, 1)
        print(f"small: {taken[0]:.1f} ms a frame set, least ratio {min(ratios):.3f}, allowed {allowed:.3f}", flush=True)
        if min(ratios) <= allowed:
            return
    sys.exit(f"small: more than {_ALLOWED} times the stored ratio")


if __name__ == "__main__":
    main()
