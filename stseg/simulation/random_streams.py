"""Lots that are drawn alike wherever and whenever they are asked for."""

from __future__ import annotations

from enum import IntEnum

import numpy as np


class Topic(IntEnum):
    """What a lot decides; each has its own stream."""

    CAMERA = 1
    LIGHT = 2
    ROOM = 3
    CROWD = 4
    PERSON = 5
    CLOTHES = 6
    SENSOR = 7
    DETECTOR = 8


def chance(seed: int, topic: Topic, *which: int) -> np.random.Generator:
    """The generator for one thing: a camera, a person, a camera's frame."""
    return np.random.default_rng([seed, int(topic), *which])
