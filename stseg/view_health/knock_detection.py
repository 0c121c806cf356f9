"""Change detection for a camera that was knocked while it recorded.

Input is an agreement score of each frame and view, higher is better: either the shift of the view's background
(`background_shift`), which shows a knock of a pixel, or its residual against the other views
(`stseg.view_health.run_check`), which needs no picture but a larger knock. A knock is a downward step of one view's
score relative to the median of the others: where all fall at once, the scene changed (a crowd, the light).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from scipy.fft import irfft2, rfft2

from stseg.arrays import Bytes, Floats, Singles

_LEAST_FRAMES = 20
"""Least number of scored frames on either side of a step."""
_STEP_ERRORS = 6.0
"""Least size of a step, in its standard errors."""
_STEP_DEVIATIONS = 1.0
"""Least size of a step, in standard deviations of single frames; smaller ones are harmless."""
_PEAK_RADIUS = 2
"""Radius of the sub-pixel centroid around a correlation peak, pixels."""


@dataclass(frozen=True)
class Knock:
    """A downward step of a view's agreement.

    Attributes
    ----------
    view
        Index of the view.
    frame
        Index of the first frame after the knock.
    before, after
        Median score on either side, in the unit of the input.
    errors
        Size of the step in standard errors.
    """

    view: int
    frame: int
    before: float
    after: float
    errors: float


def find_knocks(agreement: Floats, least: float = 0.0) -> list[Knock]:
    """Find knocked views, each once at its clearest step, in the order of the views.

    Parameters
    ----------
    agreement : float64 (frame, view)
        Agreement of each view in each frame, higher is better; nan where there is no measurement.
    least
        Smallest step that matters, in the unit of `agreement`, such as half a pixel.
    """
    found = [_step(agreement, view, least) for view in range(agreement.shape[1])]
    return [knock for knock in found if knock is not None]


def background_shift(background: Bytes, image: Bytes) -> Floats:
    """Shift (u, v) of an image's edges against the background, pixels, float64 (2,).

    Phase correlation of the edges (Kuglin and Hines, The phase correlation image alignment method, 1975), which people
    and changes of light disturb little.

    Parameters
    ----------
    background, image : uint8 (v, u, 3)
        Of one size.
    """
    # With SciPy's transforms: OpenCV's differ in the last digits from one call to the next.
    one, other = (rfft2(_edges(picture) * _window(*picture.shape[:2])) for picture in (background, image))
    crossed = np.conj(one) * other
    likeness = irfft2(crossed / np.maximum(np.abs(crossed), np.float32(1e-12)), image.shape[:2])
    return _peak(np.asarray(likeness))


@lru_cache(maxsize=8)  # shapes of a rig's images
def _window(rows: int, columns: int) -> Singles:
    """Hann window: the image's borders would otherwise count as edges that do not move."""
    return np.outer(np.hanning(rows), np.hanning(columns)).astype(np.float32)


def _peak(likeness: Singles) -> Floats:
    """Sub-pixel position (u, v) of the correlation peak: the centroid around the highest pixel."""
    middle = np.array(likeness.shape) // 2
    centred = np.roll(likeness, tuple(middle), (0, 1))
    v, u = map(int, np.unravel_index(int(np.argmax(centred)), centred.shape))
    rows = np.arange(max(v - _PEAK_RADIUS, 0), min(v + _PEAK_RADIUS + 1, centred.shape[0]))
    columns = np.arange(max(u - _PEAK_RADIUS, 0), min(u + _PEAK_RADIUS + 1, centred.shape[1]))
    weight = np.maximum(centred[np.ix_(rows, columns)], 0.0)
    centre = np.array([weight.sum(0) @ columns, weight.sum(1) @ rows]) / max(float(weight.sum()), 1e-12)
    return np.asarray(centre - middle[::-1])


def _edges(image: Bytes) -> Singles:
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    across, down = (np.asarray(cv2.Sobel(grey, cv2.CV_16S, *step), np.float32) for step in ((1, 0), (0, 1)))
    # The fourth root, so that strong edges count little more than weak ones. Roots are rounded exactly, logarithms are
    # not: equal pictures give equal results to the last bit.
    return np.asarray(np.sqrt(np.sqrt(across**2 + down**2)))


def _step(agreement: Floats, view: int, least: float) -> Knock | None:
    relative = agreement[:, view] - _median(np.delete(agreement, view, axis=1))
    rows = np.flatnonzero(np.isfinite(relative))
    if len(rows) < 2 * _LEAST_FRAMES:
        return None
    # Outlier frames must not look like steps.
    centre, wide = np.median(relative[rows]), 6 * _spread(relative[rows])
    values = np.clip(relative[rows], centre - wide, centre + wide)
    cut = _cut(values)
    before, after = values[:cut], values[cut:]
    residual = np.concatenate([before - before.mean(), after - after.mean()])
    step, spread = float(before.mean() - after.mean()), max(float(residual.std()), 1e-9)
    errors = step / (spread * np.sqrt(_frames_per_sample(residual) * (1 / len(before) + 1 / len(after))))
    # The clipped scores decide significance, the medians the size of the step.
    drop = float(np.median(relative[rows][:cut]) - np.median(relative[rows][cut:]))
    if errors < _STEP_ERRORS or step < _STEP_DEVIATIONS * spread or drop < least:
        return None
    score = agreement[rows, view]
    return Knock(view, int(rows[cut]), float(np.median(score[:cut])), float(np.median(score[cut:])), float(errors))


def _cut(values: Floats) -> int:
    """Change point: number of values before it in the best fit of two levels, the first the higher."""
    count = np.arange(_LEAST_FRAMES, len(values) - _LEAST_FRAMES + 1)
    total = np.concatenate([[0.0], np.cumsum(values)])
    before, after = total[count] / count, (total[-1] - total[count]) / (len(values) - count)
    return int(count[np.argmax((before - after) * np.sqrt(count * (len(values) - count)))])


def _median(values: Floats) -> Floats:
    """Median over the views (frame, view) with a measurement; nan where none has one, float64 (frame,)."""
    median = np.full(len(values), np.nan if values.shape[1] else 0.0)
    some = np.isfinite(values).any(axis=1)
    median[some] = np.nanmedian(values[some], axis=1)
    return median


def _spread(values: Floats) -> float:
    """Robust standard deviation (scaled median absolute deviation)."""
    return 1.4826 * float(np.median(np.abs(values - np.median(values))))


def _frames_per_sample(residual: Floats) -> float:
    """Frames per independent frame under an AR(1) model of the scores."""
    correlation = float((residual[1:] * residual[:-1]).sum() / max(float((residual**2).sum()), 1e-12))
    correlation = min(max(correlation, 0.0), 0.95)
    return (1 + correlation) / (1 - correlation)
