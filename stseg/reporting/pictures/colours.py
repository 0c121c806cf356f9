"""Colours of the pictures: one for each track, the same everywhere, and the neutral tones around them.

Hues step by the golden angle, so that any few ids in a row lie far apart; lightness changes in a cycle of three, so
that neighbours on the hue circle still differ. Lightness and chroma are those of OKLCH (B. Ottosson, "A perceptual
color space for image processing", 2020): no track shouts louder than another, on white or on dark ground.
"""

from functools import lru_cache

import numpy as np

from stseg.arrays import Bytes

Colour = tuple[int, int, int]
"""Blue, green, red, 0..255: OpenCV's order."""
Picture = Bytes
"""uint8 (v, u, 3): blue, green, red."""

INK: Colour = (52, 46, 42)
QUIET: Colour = (138, 130, 124)
RULE: Colour = (222, 217, 213)
PAPER: Colour = (255, 255, 255)
NIGHT: Colour = (42, 35, 31)

_GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5.0))
_HUE_OF_ZERO = np.radians(117.5)  # makes id 1 blue
_LIGHTNESS = (0.70, 0.55, 0.60)
_CHROMA = 0.19
_LMS_OF_OKLAB = np.array(
    [[1.0, 0.3963377774, 0.2158037573], [1.0, -0.1055613458, -0.0638541728], [1.0, -0.0894841775, -1.2914855480]]
)
_RGB_OF_LMS = np.array(
    [
        [4.0767416621, -3.3077115913, 0.2309699292],
        [-1.2684380046, 2.6097574011, -0.3413193965],
        [-0.0041960863, -0.7034186147, 1.7076147010],
    ]
)


@lru_cache(maxsize=4096)
def track_colour(identity: int) -> Colour:
    """The colour of a track in every picture."""
    lightness = _LIGHTNESS[identity % 3]
    hue = _HUE_OF_ZERO + identity * _GOLDEN_ANGLE
    for chroma in np.linspace(_CHROMA, 0.0, 20):
        oklab = np.array([lightness, float(chroma) * np.cos(hue), float(chroma) * np.sin(hue)])
        linear = np.asarray(_RGB_OF_LMS @ (_LMS_OF_OKLAB @ oklab) ** 3)
        if linear.min() >= 0 and linear.max() <= 1:  # the screen can show it
            break
    srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.clip(linear, 0, None) ** (1 / 2.4) - 0.055)
    red, green, blue = np.rint(255 * srgb).astype(int).tolist()
    return blue, green, red


def track_palette() -> Bytes:
    """Colours of track ids, uint8 (256, 3), red, green, blue; id 0, the background, is black."""
    return np.array([(0, 0, 0), *(track_colour(identity)[::-1] for identity in range(1, 256))], np.uint8)


def hex_colour(colour: Colour) -> str:
    """`#rrggbb`, for HTML."""
    blue, green, red = colour
    return f"#{red:02x}{green:02x}{blue:02x}"


def mixed(colour: Colour, other: Colour, share: float) -> Colour:
    """`colour` with a share 0..1 of `other`."""
    blue, green, red = (round(a + (b - a) * share) for a, b in zip(colour, other, strict=True))
    return blue, green, red
