"""Our background models beside OpenCV's MOG2 and KNN, on films with exact masks and on recordings.

    python tools/bench_foreground.py [--films walk,lamp] [--recordings uu4_colour --data ../shared/data]
                                     [--models Mixture,Codebook] [--json FILE] [--pictures FOLDER]

All learn the same frames of the empty scene. Area under the precision-recall curve of all pixels of all frames: ours
from one pass of soft maps with watched light, the peers' from the best points of 28 passes or, in long films, 56: over
thresholds, with and without their shadow detection, at the rate they choose and at a steady one, with a memory of 500
and of 5000 frames. Then the largest overlap
(intersection over union) with the masks at one level for all frames, and the median processor time of a frame of
720x576 on one thread.
"""

from __future__ import annotations

import os

os.environ.setdefault("NUMBA_NUM_THREADS", "1")

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import cv2
import numpy as np
from bench_films import FILMS, Shot, shoot
from bench_methods import HISTORY, LEVELS, MODELS, Count, Setting, area_under, ours, settings
from bench_recordings import RECORDINGS

from stseg.arrays import Bytes, Floats

TIMED = (720, 576)
PICTURED = 4
"""Frames of the first camera that pictures are made of."""


def judge(shots: Sequence[Shot], name: str, pictures: Path | None) -> Count:
    """One pass of a model of ours over all cameras."""
    count = Count()
    for number, shot in enumerate(shots):
        model = ours(name, _size(shot), shot.rate)
        for image in shot.empty:
            model.learn(image)
        for frame, (image, mask) in enumerate(zip(shot.images, shot.masks, strict=True)):
            likelihood = model.likelihood(image)
            count.add(likelihood, mask)
            if pictures and number == 0 and frame % (len(shot.images) // PICTURED) == len(shot.images) // PICTURED - 1:
                grey = [np.repeat(m[..., None], 3, 2) for m in (mask * np.uint8(255), (likelihood * 255).astype("u1"))]
                cv2.imwrite(str(pictures / f"{name}_{frame:04d}.png"), np.hstack([image, *grey]))
    return count


def _size(shot: Shot) -> tuple[int, int]:
    height, width = shot.masks[0].shape
    return width, height


def mask_point(shots: Sequence[Shot], setting: Setting) -> Floats:
    """False and true positives of one pass of a peer, float64 (2,)."""
    point = np.zeros(2)
    for shot in shots:
        peer = setting.make()
        for image in shot.empty:
            peer.learn(image)
        for image, people in zip(shot.images, shot.masks, strict=True):
            mask = peer.mask(image)
            true = np.count_nonzero(mask & people)
            point += (np.count_nonzero(mask) - true, true)
    return point


def compare(shots: Sequence[Shot], models: Sequence[str], pictures: Path | None) -> dict[str, tuple[float, float]]:
    """Area under the curve and largest overlap of each model and peer."""
    people = sum(int(mask.sum()) for shot in shots for mask in shot.masks)
    others = sum(mask.size for shot in shots for mask in shot.masks) - people
    points = {name: judge(shots, name, pictures).points() for name in models}
    frames = min(len(shot.empty) + len(shot.images) for shot in shots)
    for peer in LEVELS:
        points[peer] = np.array([mask_point(shots, setting) for setting in settings(peer, frames)])
    overlap = {name: float((p[:, 1] / (people + p[:, 0])).max()) for name, p in points.items()}
    return {name: (area_under(p, people, others), overlap[name]) for name, p in points.items()}


def milliseconds(models: Sequence[str], rounds: int = 60) -> dict[str, float]:
    """Median processor time of a frame of 720x576 of each method, all of them in turns on one thread."""
    cv2.setNumThreads(1)
    shot = shoot("shadows")
    empty = [np.asarray(cv2.resize(image, TIMED), np.uint8) for image in shot.empty]
    images = [np.asarray(cv2.resize(image, TIMED), np.uint8) for image in shot.images[:rounds]]
    asked: dict[str, Callable[[Bytes], object]] = {}
    for name in models:
        model = ours(name, TIMED, shot.rate)
        for image in empty:
            model.learn(image)
        asked[name] = model.likelihood
    for peer_name, level in (("MOG2", 16.0), ("KNN", 400.0)):
        peer = Setting(peer_name, level, True, HISTORY[0], False).make()
        for image in empty:
            peer.learn(image)
        asked[peer_name] = peer.mask
    times: dict[str, list[float]] = {name: [] for name in asked}
    for image in images:
        for name, ask in asked.items():
            start = time.thread_time()
            ask(image)
            times[name].append(time.thread_time() - start)
    return {name: 1e3 * float(np.median(taken[5:])) for name, taken in times.items()}


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def score_table(found: dict[str, dict[str, tuple[float, float]]], which: int, what: str) -> str:
    """One of the scores of all scenes; the best in bold."""
    rows = []
    for scene, scores in found.items():
        best = max(score[which] for score in scores.values())
        cells = [f"{score[which]:.3f}" for score in scores.values()]
        rows.append([scene, *(f"**{cell}**" if cell == f"{best:.3f}" else cell for cell in cells)])
    return table([what, *next(iter(found.values()))], rows)


def time_table(taken: dict[str, float]) -> str:
    """Times, and how many times MOG2's they are."""
    rows = [[n, f"{t:.1f}", f"{1e3 / t:.0f}", f"{t / taken['MOG2']:.2f}"] for n, t in taken.items()]
    return table(["720x576", "ms a frame", "frames/s", "times MOG2"], rows)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--films", default=",".join(FILMS))
    parser.add_argument("--recordings", default="")
    parser.add_argument("--data", type=Path)
    parser.add_argument("--models", default=",".join(MODELS))
    parser.add_argument("--json", type=Path)
    parser.add_argument("--pictures", type=Path)
    asked = parser.parse_args()
    models = asked.models.split(",")
    found = {}
    for name in filter(None, (*asked.films.split(","), *asked.recordings.split(","))):
        folder = asked.pictures / name if asked.pictures else None
        if folder:
            folder.mkdir(parents=True, exist_ok=True)
        found[name] = compare(RECORDINGS[name](asked.data) if name in RECORDINGS else [shoot(name)], models, folder)
        print(name, {method: round(score[0], 3) for method, score in found[name].items()}, file=sys.stderr, flush=True)
    taken = milliseconds(models)
    if found:
        print(score_table(found, 0, "area under the curve"), end="\n\n")
        print(score_table(found, 1, "largest overlap"), end="\n\n")
    print(time_table(taken))
    if asked.json:
        asked.json.write_text(json.dumps({"scores": found, "milliseconds": taken}, indent=1) + "\n")


if __name__ == "__main__":
    main()
