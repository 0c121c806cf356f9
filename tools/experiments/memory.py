"""Memory of `stseg run` over a long recording: a simulated scene of many frames, sampled while it runs.

    python tools/experiment.py memory --frames 100000 --size 48,36 --people 1
    python tools/experiment.py memory --frames 10000 --rig film/rig.toml

Without --rig, a small scene of two cameras is filmed first. Prints the resident memory while segments are tracked, by
tenths of that time, while the run file is written from them, and how large the run file is.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
import tomllib
from itertools import pairwise
from pathlib import Path
from statistics import median

STSEG = [sys.executable, "-c", "import sys; from stseg.commands.main import main; sys.exit(main())"]
FRAME_RATE = 15


def resident(process: int) -> float:
    """Resident memory of a process, MiB; Linux alone tells it this way."""
    for line in Path(f"/proc/{process}/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) / 1024
    return 0.0


def sample(command: list[str], run: Path) -> tuple[list[float], list[float]]:
    """Run a command that makes a run file; its memory once a second, MiB, before and while that is written."""
    tracking: list[float] = []
    writing: list[float] = []
    part = run.with_name(f"{run.name}.part")
    with subprocess.Popen(command) as process:
        while process.poll() is None:
            (writing if part.exists() else tracking).append(resident(process.pid))
            time.sleep(1)
    if process.returncode:
        raise SystemExit(process.returncode)
    return [value for value in tracking if value > 0], [value for value in writing if value > 0]


def tenths(samples: list[float]) -> list[float]:
    """Medians over tenths of the time, MiB."""
    bounds = [k * len(samples) // 10 for k in range(11)]
    return [median(samples[a : max(b, a + 1)]) for a, b in pairwise(bounds)]


def filmed(asked: argparse.Namespace) -> Path:
    """The rig of a small scene, filmed unless it is there."""
    scene: Path = asked.work / "scene"
    if not (scene / "rig.toml").exists():
        film = ["simulate", str(scene), "--scene", "tiny", "--size", asked.size, "--people", asked.people]
        length = ["--frame-rate", str(FRAME_RATE), "--seconds", str(asked.frames / FRAME_RATE)]
        subprocess.run([*STSEG, *film, *length, "--overwrite"], check=True)
    return scene / "rig.toml"


def main() -> None:
    """Film, run, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=10_000)
    parser.add_argument("--rig", type=Path)
    parser.add_argument("--size", default="64,48")
    parser.add_argument("--people", default="2")
    parser.add_argument("--work", type=Path, default=Path("build/memory"))
    asked = parser.parse_args()
    rig, run = asked.rig or filmed(asked), asked.work / "run.h5"
    asked.work.mkdir(parents=True, exist_ok=True)
    start = time.monotonic()
    part = ["--frames", f"0:{asked.frames}", "--overwrite"]
    tracking, writing = sample([*STSEG, "run", str(rig), "-o", str(run), *part], run)
    print(f"{asked.frames} frames in {time.monotonic() - start:.0f} s")
    print("MiB while tracking, by tenths:", " ".join(f"{value:.0f}" for value in tenths(tracking)))
    print(
        f"MiB at most: {max(tracking):.0f} while tracking, {max(writing, default=0):.0f} while the run file is written"
    )
    hours = asked.frames / tomllib.loads(rig.read_text("utf-8"))["scene"]["frame_rate"] / 3600
    print(f"run file: {run.stat().st_size / 1e6:.0f} MB, {run.stat().st_size / 1e6 / hours:.0f} MB an hour")
