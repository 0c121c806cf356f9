"""What a view that fails for three seconds costs, beside its absence.

    python tools/experiment.py failing -o docs/development/failing.md [--uu4 RIG.toml --uu4-truth TRACKS.csv]

Each camera in turn fails in frames 40 to 69 of 110; the table has MODA in these frames, percent, of the default
tracker: mean over the cameras, and the least.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from workbench import commit

from experiments.spoil import crowd, recorded
from experiments.target_trials import Recorded, filmed
from stseg import Tracker
from stseg.arrays import Boxes, Bytes, Observation
from stseg.evaluation import evaluate
from stseg.simulation import NAMED

FIRST, STOP, FRAMES = 40, 70, 110
PIXELS = 15
"""How far a camera is pushed, pixels."""
_PAGE = """# What a view that fails for three seconds costs

MODA in these seconds, percent, of the default tracker: mean over the cameras, of which each fails in turn, and the
least of them; `absent` is a camera that delivers nothing. `pushed` is a camera whose picture lies {pixels} pixels
beside. Made by `tools/experiment.py failing` at commit {commit}.

"""


FAILURES = ("absent", "black", "frozen", "pushed", "white", "noise", "brighter")
OF_PICTURES, OF_COLOUR = ("white", "noise"), ("brighter",)
"""Failures that boxes, and masks, do not have."""


def failing(view: Observation, failure: str, last: Observation, frame: int) -> Observation:
    """What a camera delivers that fails, from what it would deliver and its last picture before."""
    if failure in ("absent", "frozen"):
        return last if failure == "frozen" else None
    return _boxes(view, failure) if isinstance(view, Boxes) else _picture(np.asarray(view, np.uint8), failure, frame)


def _boxes(view: Boxes, failure: str) -> Boxes:
    if failure == "black":
        return Boxes(np.zeros((0, 4)), np.zeros(0))
    return replace(view, pixel=view.pixel + np.array([PIXELS, 0, 0, 0]))


def _picture(view: Bytes, failure: str, frame: int) -> Bytes:
    match failure:
        case "black":
            return np.zeros_like(view)
        case "pushed":
            return np.asarray(np.roll(view, PIXELS, axis=1), np.uint8)
        case "white":
            return np.full_like(view, 255)
        case "noise":
            return np.random.default_rng(frame).integers(0, 256, view.shape, np.uint8)
        case _:
            return np.asarray(np.clip(view.astype(int) + 90, 0, 255), np.uint8)


def recordings(asked: argparse.Namespace) -> Iterator[tuple[str, Recorded]]:
    """The recordings, by name."""
    easy = NAMED["easy"]
    for kind in ("masks", "colour", "boxes"):
        yield f"easy, {kind}", filmed(easy, kind)(FRAMES)
    yield "easy, 3 cameras, masks", filmed(replace(easy, cameras=3, seed=31), "masks")(FRAMES)
    for cameras, seed in ((4, 77), (3, 131)):
        shown = crowd(8, cameras, FRAMES / 10, seed=seed)
        for kind, by_boxes in (("masks", False), ("boxes", True)):
            made = Recorded(shown.rig, shown.truth, list(shown.spoiled([], by_boxes)))
            yield f"crowd of 8, {cameras} cameras, {kind}", made
    if asked.uu4 is not None:
        shown = recorded(asked.uu4, asked.uu4_truth, 0, FRAMES)
        yield "uu4, masks", Recorded(shown.rig, shown.truth, [tuple(v.mask for v in views) for views in shown.frames])


def failed(made: Recorded, camera: int, failure: str) -> Recorded:
    """A recording in which a camera fails."""
    last, frames = made.frames[FIRST - 1][camera], []
    for frame, views in enumerate(made.frames):
        own = list(views)
        if FIRST <= frame < STOP:
            own[camera] = failing(own[camera], failure, last, frame)
        frames.append(tuple(own))
    return replace(made, frames=frames)


def score(made: Recorded) -> float:
    """MODA while the camera fails."""
    tracker, results = Tracker(made.rig, empty=made.empty), []
    for views in made.frames:
        results += tracker.add(views)
    rows = tracker.tracks(results + tracker.finish()).trajectory
    flagged = "flag" in (made.truth.dtype.names or ())
    found = evaluate(made.truth, rows, frames=np.arange(FIRST, STOP), ignore_flagged=flagged)
    return float(found.moda or 0.0)


def cell(made: Recorded, failure: str) -> str:
    """Mean and least MODA over the cameras."""
    view = made.frames[0][0]
    if isinstance(view, Boxes) and failure in OF_PICTURES + OF_COLOUR:
        return "-"
    if failure in OF_COLOUR and not made.empty:
        return "-"
    found = [score(failed(made, camera, failure)) for camera in range(len(made.rig.cameras))]
    return f"{np.mean(found):.1f} ({min(found):.1f})"


def main() -> None:
    """Write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--uu4", type=Path)
    parser.add_argument("--uu4-truth", type=Path)
    asked = parser.parse_args()
    head = _PAGE.format(pixels=PIXELS, commit=commit())
    lines = [f"| recording | whole | {' | '.join(FAILURES)} |", f"| --- | --- |{' --- |' * len(FAILURES)}"]
    for name, made in recordings(asked):
        lines.append(f"| {name} | {score(made):.1f} | {' | '.join(cell(made, failure) for failure in FAILURES)} |")
        print(lines[-1], flush=True)
        asked.output.write_text(head + "\n".join(lines) + "\n", "utf-8")
