"""Memory of `stseg run` over a long recording: a simulated scene of many frames, sampled while it runs.

    python tools/memory.py [--frames 10000] [--work FOLDER]

Prints the resident memory at tenths of the run, and the growth from the first tenth to the last, in MiB.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from pathlib import Path

STSEG = [sys.executable, "-c", "import sys; from stseg.commands.main import main; sys.exit(main())"]
FRAME_RATE = 10


def resident(process: int) -> float:
    """Resident memory of a process, MiB; Linux alone tells it this way."""
    for line in Path(f"/proc/{process}/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) / 1024
    return 0.0


def sample(command: list[str]) -> list[float]:
    """Run a command; its memory once a second, MiB."""
    samples = []
    with subprocess.Popen(command) as process:
        while process.poll() is None:
            samples.append(resident(process.pid))
            time.sleep(1)
    if process.returncode:
        raise SystemExit(process.returncode)
    return [value for value in samples if value > 0]


def main() -> None:
    """Film, run, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=10_000)
    parser.add_argument("--work", type=Path, default=Path("build/memory"))
    asked = parser.parse_args()
    scene, run = asked.work / "scene", asked.work / "run.h5"
    if not (scene / "rig.toml").exists():
        seconds = str(asked.frames / FRAME_RATE)
        film = ["simulate", str(scene), "--scene", "tiny", "--frame-rate", str(FRAME_RATE), "--seconds", seconds]
        subprocess.run([*STSEG, *film, "--overwrite"], check=True)
    samples = sample([*STSEG, "run", str(scene / "rig.toml"), "-o", str(run), "--overwrite"])
    tenths = [samples[min(len(samples) - 1, k * len(samples) // 10)] for k in range(1, 11)]
    print("MiB at tenths:", " ".join(f"{value:.0f}" for value in tenths))
    print(f"growth from the first tenth to the last: {tenths[-1] - tenths[0]:.0f} MiB over {len(samples)} s")


if __name__ == "__main__":
    main()
