"""Clothing: two colours and a pattern for each body part."""

import colorsys
from functools import lru_cache

import numpy as np

from stseg.arrays import Floats
from stseg.simulation.rendering.body import PARTS
from stseg.simulation.scene import Topic, random_stream

_SKIN = ((150, 175, 215), (120, 150, 200), (85, 115, 165), (50, 70, 110), (140, 165, 225))
_HAIR = ((25, 25, 30), (30, 45, 70), (60, 100, 140), (110, 170, 205), (130, 130, 135), (20, 35, 90))


_OWN_TONE = 0.2
"""Share of a person's own colours in those of people who dress alike, 0..1."""


@lru_cache(maxsize=1024)
def own_clothing(seed: int, person: int) -> Floats:
    """Paint of one person's parts, float64 (part, 10).

    Two colours (blue, green, red, 0..255), then the pattern's steps ahead, aside and along the part, within its half
    axes, and their offset along it. The second colour is where the sum of the steps is odd.
    """
    rng = random_stream(seed, Topic.CLOTHES, person)
    skin, hair = _SKIN[int(rng.integers(len(_SKIN)))], _HAIR[int(rng.integers(len(_HAIR)))]
    shirt, trousers = _pattern(rng), _pattern(rng)
    shoes = np.concatenate([_cloth(rng) * 0.5] * 2 + [np.zeros(4)])
    long_sleeves, long_trousers = rng.uniform() < 0.6, rng.uniform() < 0.8
    bare = np.array([*skin, *skin, 0, 0, 0, 0], float)
    paint_of = {
        "head": np.array([*skin, *hair, 0.0, 0.0, 0.7, 0.71]),
        "neck": bare,
        "chest": shirt,
        "hips": trousers,
        "upper arm": shirt,
        "forearm": shirt if long_sleeves else bare,
        "thigh": trousers,
        "shin": trousers if long_trousers else bare,
        "foot": shoes,
    }
    return np.stack([paint_of[part.name.removeprefix("left ").removeprefix("right ")] for part in PARTS])


def clothing(seed: int, person: int, alike: int) -> Floats:
    """Clothing where the first `alike` people dress like the first one, in slightly different tones."""
    clothes = own_clothing(seed, person)
    if person > alike:
        return clothes
    first = own_clothing(seed, 1)
    paint = first.copy()
    paint[:, :6] += _OWN_TONE * (clothes - first)[:, :6]
    return paint


def _pattern(rng: np.random.Generator) -> Floats:
    """A garment: plain, striped across, striped along, or chequered."""
    first, second = _cloth(rng), _cloth(rng)
    across, along = ((0, 0), (0, 3), (2.5, 0), (2, 2.5))[int(rng.choice(4, p=(0.4, 0.3, 0.15, 0.15)))]
    return np.array([*first, *second, 0.0, across, along, rng.uniform()])


def _cloth(rng: np.random.Generator) -> Floats:
    """A colour of cloth: dark and dull ones are commoner than bright ones."""
    red, green, blue = colorsys.hsv_to_rgb(rng.uniform(), rng.beta(1.2, 1.8), rng.uniform(0.08, 0.95))
    return 255.0 * np.array([blue, green, red])
