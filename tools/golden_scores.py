"""Make tests/golden/evaluation.json: small crowds, and what the reference scorer says of them.

    python tools/golden_scores.py SCORE.PY > tests/golden/evaluation.json

SCORE.PY is the reference scorer (`--truth --tracks [--gate --area --frames --ignore-flagged]`, JSON on standard
output). It needs TrackEval, which brings its own OpenCV along: run this in an environment of its own.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

CASES: dict[str, list[str]] = {
    "plain": [],
    "narrow gate": ["--gate", "0.3"],
    "wide gate": ["--gate", "1.0"],
    "area": ["--area=0.3,0.3,2.0,2.4"],
    "flags": ["--ignore-flagged"],
    "flags and area": ["--ignore-flagged", "--area=0.3,0.3,2.0,2.4"],
    "half the frames": ["--frames", "6:20"],
    "more frames than truth": ["--frames", "0:40"],
    "some frames": ["--frames", "3,4,11,30"],
    "nobody there": ["--frames", "100:110"],
}


def crowd(seed: int, people: int = 5, frames: int = 24, side: float = 2.5) -> tuple[list[str], list[str]]:
    """CSV lines of truth and tracks: walkers who leave and return, tracks that jitter, break, swap and invent."""
    rng = np.random.default_rng(seed)
    ground = rng.uniform(0, side, (people, 2))
    name = list(range(1, people + 1))
    truth, tracks = ["frame,id,x,y,flag"], ["frame,id,x,y"]
    for frame in range(frames):
        ground += rng.normal(0, 0.12, ground.shape)
        if rng.random() < 0.15:
            one, other = rng.choice(people, 2, replace=False)
            name[one], name[other] = name[other], name[one]
        for person, place in enumerate(ground):
            if rng.random() < 0.05:
                name[person] = 100 * frame + person
            if rng.random() < 0.9:
                truth.append(f"{frame},{person},{place[0]:.3f},{place[1]:.3f},{int(rng.random() < 0.15)}")
            x, y = place + rng.normal(0, 0.2, 2)
            if rng.random() < 0.85:
                tracks.append(f"{frame},{name[person]},{x:.3f},{y:.3f}")
        if rng.random() < 0.4:
            x, y = rng.uniform(0, side, 2)
            tracks.append(f"{frame},{90 + frame % 3},{x:.3f},{y:.3f}")
    return truth, tracks


def main() -> None:
    """Print the cases."""
    made = {}
    for seed, (case, options) in enumerate(CASES.items(), start=1):
        truth, tracks = crowd(seed)
        with tempfile.TemporaryDirectory() as folder:
            paths = [Path(folder, "truth.csv"), Path(folder, "tracks.csv")]
            for path, lines in zip(paths, (truth, tracks), strict=True):
                path.write_text("\n".join(lines) + "\n", encoding="utf-8")
            command = [sys.executable, sys.argv[1], "--truth", str(paths[0]), "--tracks", str(paths[1]), *options]
            answer = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        made[case] = {"options": options, "truth": truth, "tracks": tracks, "scores": json.loads(answer)}
    print(json.dumps(made, indent=0))


if __name__ == "__main__":
    main()
