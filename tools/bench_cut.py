"""Measure the cut against PyMaxflow on the same windows, in the same run, with the same labels.

    python tools/bench_cut.py [--sections synthetic,wide,real,memory] [--seeds 6] [--data ../shared/data]

PyMaxflow builds its graph, solves and reads the labels; stseg does the same from the same energy. Each is the better
of two calls. Seconds are those of the processor, which other programs on the machine hardly change.
"""

from __future__ import annotations

import argparse
import pickle
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeVar

import numpy as np
from bench_windows import real, synthetic

from stseg.graphcut.cut import minimum_cut
from stseg.graphcut.grid_energy import GridEnergy
from stseg.graphcut.pymaxflow import grid_cut

T = TypeVar("T")
_REAL = {"uu4": "0:40", "cmc1": "0:40", "cmc2": "0:40", "wildtrack": "0:20"}
_LEVELS, _TOTALS = (-1.0, -1.5), (1.0, 3.0, 6.0)  # nats


@dataclass(frozen=True)
class Row:
    """One line of a table: a name, and figures by column."""

    name: str
    figures: dict[str, float]


def print_table(title: str, rows: Iterable[Row]) -> list[Row]:
    """Print rows as they come, then the median and the least of each column."""
    print(f"\n## {title}\n")
    done: list[Row] = []
    for row in rows:
        if not done:
            print("| window | " + " | ".join(row.figures) + " |")
            print("|---" * (len(row.figures) + 1) + "|")
        done.append(row)
        _print_row(row)
    for name, of in (("median", np.median), ("least", np.min)):
        if done:
            _print_row(Row(name, {key: float(of([row.figures[key] for row in done])) for key in done[0].figures}))
    return done


def _print_row(row: Row) -> None:
    print(f"| {row.name} | " + " | ".join(f"{figure:.4g}" for figure in row.figures.values()) + " |", flush=True)


def compare(name: str, energy: GridEnergy) -> Row:
    """Ratios on one window."""
    theirs, peer = _timed(grid_cut, energy)
    cut, ours = _timed(minimum_cut, energy)
    if (cut.occupied != theirs.occupied).any():
        sys.exit(f"bench_cut.py: {name}: labels differ from PyMaxflow's")
    share = 100 * cut.nodes / energy.unary.size
    return Row(name, {"PyMaxflow ms": 1e3 * peer, "stseg ms": 1e3 * ours, "ratio": peer / ours, "left %": share})


def _timed(solve: Callable[[GridEnergy], T], energy: GridEnergy) -> tuple[T, float]:
    """Result of a call, and the better of two in seconds of the processor."""
    seconds = []
    for _ in range(2):
        start = time.process_time()
        found = solve(energy)
        seconds.append(time.process_time() - start)
    return found, min(seconds)


def synthetic_rows(seeds: int, neighbours: int = 8) -> Iterable[Row]:
    """Synthetic windows over the levels and strengths of smoothness of the study."""
    for k in range(seeds):
        level, total = _LEVELS[k % 2], _TOTALS[k // 2 % 3]
        energy = synthetic(100 + k, level, total, neighbours)
        yield compare(f"seed {100 + k}, level {level}, total {total}", energy)


def real_rows(data: Path) -> Iterable[Row]:
    """Windows of real recordings at the default energy."""
    for name, frames in _REAL.items():
        if not (data / name.rstrip("12" if name.startswith("cmc") else "")).exists():
            print(f"{name}: not at hand")
            continue
        for k, energy in enumerate(real(name, frames, data)):
            yield compare(f"{name} {k}", energy)


_PEAK = """
import pickle, sys
sys.path.insert(0, {tools!r})
import bench_cut
small, large = pickle.load(open({file!r}, "rb"))
bench_cut.SOLVERS[{solver!r}](small)  # what is loaded and compiled is no one's
before = bench_cut.resident("VmRSS")
bench_cut.SOLVERS[{solver!r}](large)
print(bench_cut.resident("VmHWM") - before)
"""


def resident(kind: str) -> float:
    """Resident memory of this process now (VmRSS) or at its peak (VmHWM), MiB; Linux alone tells it this way."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(kind):
            return int(line.split()[1]) / 1024
    return 0.0


SOLVERS: dict[str, Callable[[GridEnergy], object]] = {
    "PyMaxflow MiB": grid_cut,
    "stseg MiB": minimum_cut,
}


def memory_rows() -> Iterable[Row]:
    """What each solver adds to the peak of its own process."""
    for k in (0, 5):  # a sparse window and a dense one
        level, total = _LEVELS[k % 2], _TOTALS[k // 2 % 3]
        windows = [synthetic(100 + k, level, total, shape=shape) for shape in ((3, 3, 20, 20), (15, 10, 100, 100))]
        with TemporaryDirectory() as folder:
            file = Path(folder, "windows")
            file.write_bytes(pickle.dumps(windows))
            figures = {solver: _peak(solver, file) for solver in SOLVERS}
        figures["share"] = figures["stseg MiB"] / figures["PyMaxflow MiB"]
        yield Row(f"seed {100 + k}, level {level}, total {total}", figures)


def _peak(solver: str, file: Path) -> float:
    program = _PEAK.format(tools=str(Path(__file__).parent), file=str(file), solver=solver)
    done = subprocess.run([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True, check=True)
    return float(done.stdout.split()[-1])


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the sections that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sections", default="synthetic,wide,real,memory")
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    asked = parser.parse_args(arguments)
    sections: dict[str, tuple[str, Callable[[], Iterable[Row]]]] = {
        "synthetic": ("8 neighbours, synthetic", lambda: synthetic_rows(asked.seeds)),
        "wide": ("80 neighbours, synthetic", lambda: synthetic_rows(2, 80)),
        "real": ("8 neighbours, real recordings, default energy", lambda: real_rows(asked.data)),
        "memory": ("Memory added to the peak", lambda: memory_rows()),
    }
    compare("warm up", synthetic(0, -1.0, 3.0, shape=(3, 3, 20, 20)))
    for name in asked.sections.split(","):
        title, rows = sections[name]
        print_table(title, rows())


if __name__ == "__main__":
    main()
