"""Do the ways in which kernels are compiled agree? Tracks one rig by each and compares the run files.

    python tools/experiment.py compilers --work FOLDER [--data ../shared/data] [--rig RIG.toml] [--frames A:B]
        [--python OTHER]

The default run and one by plain `numba.njit` must give the same bits. With --python, that interpreter (another version
of numba) tracks the rig, too: it must find the same people in the same frames, to a millimetre. Without --rig,
frames of the recording `uu4` are tracked where DATA holds it, and else a simulated scene. The exit status is 1 where
runs differ. CPU seconds are printed beside: with an empty NUMBA_CACHE_DIR they are those of a first run.
"""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
from bench import RUN
from result_sets import SETS
from workbench import ROOT, Bench, command_line

from experiments.same import differences, digests
from stseg.io.runfile.runs import read_run

_TOLERANCE = 1e-3
"""Largest difference of the tracks of two versions of numba, metres."""


def start(python: str, words: list[str], **environment: str) -> subprocess.Popen[bytes]:
    """Start a command of stseg by an interpreter, without a search for garbage: it is a tenth of compiling."""
    return subprocess.Popen(
        [python, "-c", f"import gc; gc.disable(); {RUN}", *words],
        env=os.environ | {"PYTHONPATH": str(ROOT)} | environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def finish(name: str, process: subprocess.Popen[bytes]) -> None:
    """Wait for a command and print its CPU seconds; stop where it fails."""
    _, status, usage = os.wait4(process.pid, 0)
    print(f"{name}: {usage.ru_utime + usage.ru_stime:.1f} CPU s", flush=True)
    if status:
        sys.exit(f"{name}: wait status {status}")


def track_difference(run_file: Path, other_file: Path) -> float:
    """Largest difference of the tracks of two runs, metres; infinite where frames or ids differ."""
    rows, others = (read_run(path).trajectory for path in (run_file, other_file))
    if not all(np.array_equal(rows[name], others[name]) for name in ("frame", "id")):
        return np.inf
    return max((float(np.abs(rows[name] - others[name]).max(initial=0.0)) for name in ("x", "y")), default=0.0)


def prepared(bench: Bench) -> tuple[Path, str]:
    """A rig file and its frames: those of `uu4`, or of a simulated scene where the recording is not here."""
    if bench.path("$DATA/uu4").exists():
        for command in SETS["uu4"].prepare:
            bench.do(command)
        return bench.path(SETS["uu4"].rig), "0:40"
    scene = ["--scene", "easy", "--seconds", "2", "--size", "320,240", "--overwrite"]
    finish("scene", start(sys.executable, ["simulate", str(bench.work / "scene"), *scene]))
    return bench.work / "scene" / "rig.toml", "0:12"


def main() -> None:
    """Compare, a line for each way."""
    parser = command_line(__doc__)
    parser.add_argument("--rig", type=Path)
    parser.add_argument("--frames", help="all frames of --rig, if not given; of the recording 0:40, of the scene 0:12")
    parser.add_argument("--python", help="an interpreter with another version of numba")
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    rig, frames = options.rig, ":"
    if rig is None:
        rig, frames = prepared(Bench(options.data.resolve(), options.work.resolve()))
    ways: dict[str, tuple[str, dict[str, str]]] = {"default": (sys.executable, {})}
    ways["plain"] = sys.executable, {"STSEG_PLAIN_NUMBA": "1"}
    if options.python is not None:
        ways["other"] = options.python, {}
    files = {name: options.work / f"{name}.h5" for name in ways}
    words = ["run", str(rig), "--frames", options.frames or frames, "--workers", "1", "--overwrite", "-o"]
    processes = {
        name: start(python, [*words, str(files[name])], **environment) for name, (python, environment) in ways.items()
    }
    for name, process in processes.items():
        finish(name, process)
    differing = differences(digests(files["default"]), digests(files["plain"]))
    print(f"plain numba: {'differs: ' + ', '.join(differing) if differing else 'same bits'}")
    failed = bool(differing)
    if options.python is not None:
        distance = track_difference(files["default"], files["other"])
        print(f"other numba: tracks differ by {1000 * distance:.3g} mm")
        failed |= distance > _TOLERANCE
    sys.exit(1 if failed else 0)
