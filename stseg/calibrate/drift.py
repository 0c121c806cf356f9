"""A camera that was knocked while it recorded: from one frame on it agrees less with the others than before.

Each frame and view brings a number that is higher the better the view agrees: with its own background, by how little
that has moved in the image (`background_shift`), which a knock of a pixel shows; or with the other views, by the mean
evidence that it gives for the people who were accepted (`agreement_of_people`), which needs no picture but a larger
knock or a longer recording. A knock is a step down in one view's numbers. Where all views fall at once it is the scene
that changed (a crowd, the light), so each is judged against the median of the others.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from stseg.arrays import Bytes, Floats, Ints, Singles

_LEAST = 20
"""Frames with a number, before and after a step."""
_CLEAR = 6.0
"""Standard errors that a step is, at least."""
_LARGE = 1.0
"""Standard deviations of single frames that a step is, at least: what is smaller harms nobody."""


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
    one, other = _edges(background), _edges(image)
    window = cv2.createHanningWindow((one.shape[1], one.shape[0]), cv2.CV_32F)
    shift, _ = cv2.phaseCorrelate(one, other, window)
    return np.array(shift, float)


def _edges(image: Bytes) -> Singles:
    grey = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.float32)
    across, down = cv2.Sobel(grey, cv2.CV_32F, 1, 0), cv2.Sobel(grey, cv2.CV_32F, 0, 1)
    # Strong edges count no more than others: what is before the lens changes, what is behind it stays.
    return np.asarray(np.log1p(cv2.magnitude(across, down)), np.float32)


def agreement_of_people(frame: Ints, parts: Floats, frames: int) -> Floats:
    """What `find_knocks` asks for, from what each view says of the people who were accepted.

    Parameters
    ----------
    frame : int64 (n,)
        Of each person and frame, counted from the first.
    parts : float64 (n, view)
        What each view says of that person, nats; 0 where it says nothing.
    frames
        How many there are.

    Returns
    -------
    float64 (frame, view)
        Mean over the people of whom the view says something; nan where it says nothing of anybody.
    """
    total, count = (np.zeros((frames, parts.shape[1])) for _ in range(2))
    np.add.at(total, frame, parts)
    np.add.at(count, frame, parts != 0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


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
    if errors < _CLEAR or step < max(_LARGE * spread, least):
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
