"""Recordings that background models are compared on, beside films: see the data's own README for what they are."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from bench_films import Shot

from stseg.arrays import Bytes

__all__ = ["RECORDINGS"]

_CAMERAS = (1, 2, 3, 4)


def _frames(path: Path, every: int = 1) -> Iterator[Bytes]:
    stream = cv2.VideoCapture(str(path))
    number = 0
    while True:
        found, image = stream.read()
        if not found:
            break
        if number % every == 0:
            yield np.asarray(image, np.uint8)
        number += 1
    stream.release()


def dressed(data: Path) -> list[Shot]:
    """`uu4_colour`: real silhouettes in plain clothes; the masks are exact."""
    return [_shot(data / f"uu4/cam{k}", data / f"uu4_colour/cam{k}.avi", "foreground_cropped", 5.0) for k in _CAMERAS]


def sitting(data: Path) -> list[Shot]:
    """`uu1`, every fifth frame: one person, filmed; the masks are somebody's, not truth."""
    folders = [data / f"uu1/cam{k}" for k in _CAMERAS]
    return [_shot(folder, folder / "video.avi", "foreground_mask", 10.0, 5) for folder in folders]


def _shot(folder: Path, video: Path, masks: str, rate: float, every: int = 1) -> Shot:
    images = list(_frames(video, every))
    people = [mask[:, :, 0] > 127 for mask in _frames(folder / f"{masks}.avi", every)][: len(images)]
    return Shot(rate, list(_frames(folder / "background.avi")), images[: len(people)], people)


RECORDINGS = {"uu4_colour": dressed, "uu1": sitting}
"""By name: the shots of all cameras, from the folder of data sets."""
