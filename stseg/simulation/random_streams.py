"""Independent random streams by topic, equal wherever and whenever they are drawn from."""

from __future__ import annotations

from enum import IntEnum

import numpy as np


class Topic(IntEnum):
    """Topic of a random stream."""

    CAMERA = 1
    LIGHT = 2
    ROOM = 3
    CROWD = 4
    PERSON = 5
    CLOTHES = 6
    SENSOR = 7
    DETECTOR = 8
    SPOIL = 9
    ARRIVALS = 10


def random_stream(seed: int, topic: Topic, *which: int) -> np.random.Generator:
    """Generator of one topic and item: a camera, a person, a camera's frame."""
    return np.random.default_rng([seed, int(topic), *which])
