"""Share of pixels of people with the right label, film to label images: python tools/experiment.py pixels [SCENE ...]

Simulated scenes are filmed, tracked by `stseg run` and labelled by `stseg labels`, in colour and from exact masks. The
tracks are matched to the people one to one for the whole recording and all cameras, by the pixels that they share; so a
track that changes from one person to another counts for one of them only. Pixels of people outside the area count for
nothing: no track tells of them.
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import cv2
import numpy as np
from scipy.optimize import linear_sum_assignment

from stseg.arrays import Ints
from stseg.commands.main import main as stseg
from stseg.io.recording.indexed_png import decode_indexed, stores_numbers

SCENES = {
    "easy": ("--scene", "easy", "--seconds", "6"),
    "easy, 8 people": ("--scene", "easy", "--people", "8", "--seconds", "6"),
    "easy, 320x240": ("--scene", "easy", "--size", "320,240", "--seconds", "6"),
    "dense4": ("--scene", "dense4", "--seconds", "6"),
}
RIGS = {"colour": "rig.toml", "masks": "rig_masks.toml"}


def main() -> None:
    """Print a row a scene and kind of foreground."""
    print(f"{'scene':16} {'from':7} people's pixels right   labels right")
    for name in sys.argv[1:] or SCENES:
        with tempfile.TemporaryDirectory() as text:
            folder = Path(text)
            _command("simulate", folder / "film", *SCENES[name], "--instances")
            for kind, rig in RIGS.items():
                _command("run", folder / "film" / rig, "-o", folder / f"{kind}.h5")
                _command("labels", folder / f"{kind}.h5", "-o", folder / kind)
                found, kept = score(folder / "film", folder / kind)
                print(f"{name:16} {kind:7} {found:.3f}                   {kept:.3f}", flush=True)


def score(film: Path, labels: Path) -> tuple[float, float]:
    """Share of the people's pixels that are right, and of the labels."""
    inside = set(map(tuple, np.loadtxt(film / "truth.csv", int, delimiter=",", skiprows=1, usecols=(0, 1)).tolist()))
    shared: Counter[tuple[int, int]] = Counter()
    for truth, label, frame in _images(film, labels):
        pairs, counts = np.unique(np.stack([truth.ravel(), label.ravel()]), axis=1, return_counts=True)
        for (person, track), count in zip(pairs.T.tolist(), counts.tolist(), strict=True):
            if person == 0 or (frame, person) in inside:
                shared[person, track] += count
    people, tracks = (sorted({pair[k] for pair in shared} - {0}) for k in (0, 1))
    table = np.array([[shared[person, track] for track in tracks] for person in people])
    right = int(table[linear_sum_assignment(-table)].sum())
    shown = sum(count for (person, _), count in shared.items() if person)
    given = sum(count for (_, track), count in shared.items() if track)
    return right / shown, right / given


def _images(film: Path, labels: Path) -> Iterator[tuple[Ints, Ints, int]]:
    for camera in sorted(labels.iterdir()):
        for path in sorted(camera.iterdir()):
            yield _numbers(film / f"{camera.name}_instances" / path.name), _numbers(path), int(path.stem)


def _numbers(path: Path) -> Ints:
    data = path.read_bytes()
    image = decode_indexed(data) if stores_numbers(data) else cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert image is not None, path
    return image.astype(np.int64)


def _command(*arguments: object) -> None:
    with redirect_stdout(StringIO()):
        status = stseg([str(argument) for argument in arguments])
    if status:
        sys.exit(status)
