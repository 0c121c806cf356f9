"""Reprojection residuals: how far beside their places each view sees people.

They are small for all views of a sound rig, and a knocked camera shows in its first frame. A view measures places well
across its line of sight. People at a distance from all others in it, and boxes of people who stand free, are located
along that direction by this view alone and compared with their places by all views; boxes count as they were delivered,
before any alignment. The mean of one frame is rough, the median over minutes good to a centimetre or two.
"""

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.bodies.views import DetectorView, PixelView, View, ViewObservation, ViewObservations
from stseg.records.candidates import Candidates

_GREATEST_RESIDUAL, _RESIDUAL_STEP = 0.6, 0.05
"""Range of the residual to either side, and its step, metres."""
_SHIFTS = np.arange(-_GREATEST_RESIDUAL, _GREATEST_RESIDUAL + _RESIDUAL_STEP / 2, _RESIDUAL_STEP)


def reprojection_residuals(
    people: Candidates, views: Sequence[DetectorView], observations: ViewObservations, boxes: list[Ints], free: Flags
) -> Floats:
    """Mean residual of each view.

    Parameters
    ----------
    people
        Places by all views.
    views, observations
        The views, and the observation of each; None where blind.
    boxes : int64 (box,) each
        For each view the person of each box by assignment, -1 for none.
    free : bool (view, n)
        Whether a person's box counts although the person overlaps others.

    Returns
    -------
    float64 (view,)
        Mean over people who overlap no others, or are free, metres, positive to the right of the view; nan for none.
    """
    measured = np.full(len(views), np.nan)
    for k, (view, observation, owner) in enumerate(zip(views, observations, boxes, strict=True)):
        if observation is not None and len(people):
            found = _of_view(people, view, observation, owner, free[k])
            if np.isfinite(found).any():
                measured[k] = np.nanmean(found)
    return measured


def nearest_people(people: Candidates, view: View, observation: ViewObservation) -> Ints:
    """Person of the body with the nearest middle to each box, within the body's height, int64 (box,); -1 for none."""
    if not len(people):
        return np.full(len(observation.edges), -1)
    bodies = view.table.boxes_of(people.ground, people.height)
    away = np.hypot(*np.moveaxis(_middles(observation.edges)[:, None] - _middles(bodies), -1, 0))
    nearest = np.nan_to_num(away, nan=np.inf).argmin(1)
    within_height = away[np.arange(len(away)), nearest] < (bodies[:, 3] - bodies[:, 1])[nearest]
    return np.asarray(np.where(within_height, nearest, -1))


def _middles(edges: Floats) -> Floats:
    """Middles of boxes (n, 4), float64 (n, 2)."""
    return (edges[:, :2] + edges[:, 2:]) / 2


def _of_view(people: Candidates, view: DetectorView, observation: ViewObservation, owner: Ints, free: Flags) -> Floats:
    """Residual of each person, float64 (n,), metres; nan for those that overlap others and are not free."""
    found = np.full(len(people), np.nan)
    right = _right(people.ground, view)
    shifts = (-_GREATEST_RESIDUAL, 0.0, _GREATEST_RESIDUAL)
    ends = [view.table.boxes_of(people.ground + shift * right, people.height) for shift in shifts]
    is_separate = _is_separate(np.stack(ends), view)
    if isinstance(view, PixelView):
        separate = np.flatnonzero(is_separate)
        found[separate] = _by_pixels(people.at(separate), right[separate], view, observation)
        return found
    delivered = _middles(observation.edges)[:, 0] - observation.right
    for j in np.flatnonzero(is_separate | (free & np.isfinite(ends).all((0, 2)))):
        if len(boxes_of_person := np.flatnonzero(owner == j)):
            middles = [float(end[j, 0] + end[j, 2]) / 2 for end in ends]
            found[j] = np.interp(delivered[boxes_of_person[0]], middles, shifts)
    return found


def _right(ground: Floats, view: View) -> Floats:
    """The ground's direction that a view sees as to the right of each place, float64 (n, 2)."""
    ahead = ground - view.centre
    across = np.column_stack([ahead[:, 1], -ahead[:, 0]])
    return np.asarray(across / np.maximum(np.hypot(*across.T), 1e-9)[:, None])


def _is_separate(ends: Floats, view: View) -> Flags:
    """Whether a body (3, n, 4) that is shifted to either side stays in the image, and clear of all others."""
    low, high = ends[:, :, :2].min(0), ends[:, :, 2:].max(0)
    inside = np.all((low >= 0) & (high <= np.array(view.camera.size) - 1), axis=1)
    body = ends[1]
    with np.errstate(invalid="ignore"):
        meets = np.all((low[:, None] < body[None, :, 2:]) & (high[:, None] > body[None, :, :2]), axis=2)
    np.fill_diagonal(meets, False)
    return np.asarray(inside & ~meets.any(axis=1))


def _by_pixels(people: Candidates, right: Floats, view: PixelView, observation: ViewObservation) -> Floats:
    """Residual of each person by pixels, float64 (n,), metres along `right` (n, 2); nan where no shift shows them."""
    places = people.ground[:, None] + _SHIFTS[:, None] * right[:, None]
    heights, widths = (np.repeat(size[:, None], len(_SHIFTS), 1) for size in (people.height, people.width))
    unassigned, number = np.full(view.shape, -1, np.int16), np.zeros(len(people), np.int64)
    sums, area = view.open_sums(observation.raster, unassigned, number, view.tried(places, heights, widths))
    score = sums / np.maximum(area, 1.0)
    weight = np.exp(score - score.max(1, keepdims=True))
    return np.where(score.max(1) > 0, weight @ _SHIFTS / weight.sum(1), np.nan)
