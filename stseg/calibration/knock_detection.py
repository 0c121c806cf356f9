"""A camera that was knocked while it recorded: from one frame on it agrees less with the others than before.

Each frame and view brings a number that is higher the better the view agrees: with its own background, by how little
that has moved in the image (`background_shift`), which a knock of a pixel shows; or with the other views, by how far
beside their people it is (`stseg.calibration.run_check`), which needs no picture but a larger knock. A knock is a step
down in one view's numbers. Where all views fall at once it is the scene that changed (a crowd, the light), so each is
judged against the median of the others.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.fft import irfft2, rfft2

from stseg.arrays import Bytes, Floats

_LEAST = 20
"""Frames with a number, before and after a step."""
_CLEAR = 6.0
"""Standard errors that a step is, at least."""
_LARGE = 1.0
"""Standard deviations of single frames that a step is, at least: what is smaller harms nobody."""
_AROUND = 2
"""Pixels around a peak that tell where exactly it is."""


@dataclass(frozen=True)
class Knock:
    """A view that agrees less from a frame on.

    Attributes
    ----------
    view
        Its number.
    frame
        Index of the first frame after the knock.
    before, after
        The view's median number on either side, in the unit of what was handed in.
    errors
        Size of the step in standard errors.
    """

    view: int
    frame: int
    before: float
    after: float
    errors: float


def find_knocks(agreement: Floats, least: float = 0.0) -> list[Knock]:
    """The views that were knocked, and when; each once, at its clearest step, in the order of the views.

    Parameters
    ----------
    agreement : float64 (frame, view)
        How well each view agrees in each frame, higher is better; nan where it says nothing (nobody there).
    least
        A step that harms nobody, in the unit of these numbers, such as half a pixel.
    """
    found = [_step(agreement, view, least) for view in range(agreement.shape[1])]
    return [knock for knock in found if knock is not None]


def background_shift(background: Bytes, image: Bytes) -> Floats:
    """By how many pixels (u, v) a view's edges have moved since its background was learned, float64 (2,).

    Phase correlation of the edges (Kuglin and Hines, The phase correlation image alignment method, 1975): people and
    light change little of a picture's edges, and not together.

    Parameters
    ----------
    background, image : uint8 (v, u, 3)
        Of one size.
    """
    # With SciPy's transforms: OpenCV's differ in the last digits from one call to the next.
    one, other = (rfft2(_edges(picture) * _window(picture.shape[:2])) for picture in (background, image))
    crossed = np.conj(one) * other
    likeness = irfft2(crossed / np.maximum(np.abs(crossed), 1e-12), image.shape[:2])
    return _peak(np.asarray(likeness))


def _window(shape: tuple[int, ...]) -> Floats:
    """Weights that fall to 0 at an image's borders, which otherwise would count as edges that do not move."""
    return np.asarray(np.outer(*(np.hanning(side) for side in shape)))


def _peak(likeness: Floats) -> Floats:
    """The shift (u, v) at which two pictures are most alike: the centre of what stands around the highest pixel."""
    middle = np.array(likeness.shape) // 2
    centred = np.roll(likeness, tuple(middle), (0, 1))
    v, u = map(int, np.unravel_index(int(np.argmax(centred)), centred.shape))
    rows = np.arange(max(v - _AROUND, 0), min(v + _AROUND + 1, centred.shape[0]))
    columns = np.arange(max(u - _AROUND, 0), min(u + _AROUND + 1, centred.shape[1]))
    weight = np.maximum(centred[np.ix_(rows, columns)], 0.0)
    centre = np.array([weight.sum(0) @ columns, weight.sum(1) @ rows]) / max(float(weight.sum()), 1e-12)
    return np.asarray(centre - middle[::-1])


def _edges(image: Bytes) -> Floats:
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    across, down = (np.asarray(cv2.Sobel(grey, cv2.CV_16S, *step), float) for step in ((1, 0), (0, 1)))
    # The root's root, so that strong edges count little more than others: what is before the lens changes, what is
    # behind it stays. Roots are rounded exactly, logarithms not: the same pictures tell the same to the last digit.
    return np.asarray(np.sqrt(np.sqrt(across**2 + down**2)))


def _step(agreement: Floats, view: int, least: float) -> Knock | None:
    own = agreement[:, view] - _median(np.delete(agreement, view, axis=1))
    rows = np.flatnonzero(np.isfinite(own))
    if len(rows) < 2 * _LEAST:
        return None
    # Single wild frames must not look like steps.
    centre, wide = np.median(own[rows]), 6 * _spread(own[rows])
    values = np.clip(own[rows], centre - wide, centre + wide)
    cut = _cut(values)
    before, after = values[:cut], values[cut:]
    left = np.concatenate([before - before.mean(), after - after.mean()])
    step, spread = float(before.mean() - after.mean()), max(float(left.std()), 1e-9)
    errors = step / (spread * np.sqrt(_alike(left) * (1 / len(before) + 1 / len(after))))
    # The clipped step is clear or not; how large it truly is the medians say.
    drop = float(np.median(own[rows][:cut]) - np.median(own[rows][cut:]))
    if errors < _CLEAR or step < _LARGE * spread or drop < least:
        return None
    seen = agreement[rows, view]
    return Knock(view, int(rows[cut]), float(np.median(seen[:cut])), float(np.median(seen[cut:])), float(errors))


def _cut(values: Floats) -> int:
    """Where two levels, the first the higher, fit the values best: how many belong to the first."""
    count = np.arange(_LEAST, len(values) - _LEAST + 1)
    total = np.concatenate([[0.0], np.cumsum(values)])
    before, after = total[count] / count, (total[-1] - total[count]) / (len(values) - count)
    return int(count[np.argmax((before - after) * np.sqrt(count * (len(values) - count)))])


def _median(values: Floats) -> Floats:
    """Median over views (frame, view) that say something; nan where none does, float64 (frame,)."""
    median = np.full(len(values), np.nan if values.shape[1] else 0.0)
    some = np.isfinite(values).any(axis=1)
    median[some] = np.nanmedian(values[some], axis=1)
    return median


def _spread(values: Floats) -> float:
    """Robust standard deviation."""
    return 1.4826 * float(np.median(np.abs(values - np.median(values))))


def _alike(left: Floats) -> float:
    """How many neighbouring frames say what one independent frame would, were they an AR(1) process."""
    correlation = float((left[1:] * left[:-1]).sum() / max(float((left**2).sum()), 1e-12))
    correlation = min(max(correlation, 0.0), 0.95)
    return (1 + correlation) / (1 - correlation)
