"""How far beside their places a view sees people: small for all views of a sound rig, and a knock shows in its frame.

A view tells well where somebody stands across its line of sight. Whoever stands apart from everybody else in it is
looked for along that line, by what this view alone shows; all views together have said where they stand. The mean over
a frame is worth little, the median over minutes a centimetre or two.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.detection.views import BoxView, PixelView, View, ViewObservation
from stseg.model.candidates import Candidates

_REACH, _STEP = 0.6, 0.05
"""How far to either side a view is asked, and in which steps, metres."""
_SHIFTS = np.arange(-_REACH, _REACH + _STEP / 2, _STEP)


def aside(
    people: Candidates,
    views: Sequence[BoxView | PixelView],
    sights: Sequence[ViewObservation | None],
    boxes: list[Ints],
) -> Floats:
    """How far beside their places each view sees people.

    Parameters
    ----------
    people
        Where they stand by all views.
    views, sights
        The views, and what each shows; None where blind.
    boxes : int64 (box,) each
        For each view whose boxes are whose.

    Returns
    -------
    float64 (view,)
        Mean over those who stand apart, metres, positive to the right of the view; nan where nobody does.
    """
    told = np.full(len(views), np.nan)
    for k, (view, sight, owner) in enumerate(zip(views, sights, boxes, strict=True)):
        if sight is not None and len(people):
            found = _of_view(people, view, sight, owner)
            if np.isfinite(found).any():
                told[k] = np.nanmean(found)
    return told


def _of_view(people: Candidates, view: BoxView | PixelView, sight: ViewObservation, owner: Ints) -> Floats:
    """Of each person, float64 (n,), metres; nan for those who are not apart."""
    found = np.full(len(people), np.nan)
    right = _right(people.ground, view)
    ends = [view.table.boxes_of(people.ground + shift * right, people.height) for shift in (-_REACH, 0.0, _REACH)]
    for j in np.flatnonzero(_apart(np.stack(ends), view)):
        if isinstance(view, PixelView):
            found[j] = _by_pixels(people, int(j), right[j], view, sight)
        elif len(own := np.flatnonzero(owner == j)):
            middles = [float(end[j, 0] + end[j, 2]) / 2 for end in ends]
            shown = float(sight.edges[own[0], 0] + sight.edges[own[0], 2]) / 2
            found[j] = np.interp(shown, middles, (-_REACH, 0.0, _REACH))
    return found


def _right(ground: Floats, view: View) -> Floats:
    """The ground's direction that a view sees as to the right of each place, float64 (n, 2)."""
    ahead = ground - view.centre
    across = np.column_stack([ahead[:, 1], -ahead[:, 0]])
    return np.asarray(across / np.maximum(np.hypot(*across.T), 1e-9)[:, None])


def _apart(ends: Floats, view: View) -> Flags:
    """Whether a body (3, n, 4) that is shifted to either side stays in the image, and clear of all others."""
    low, high = ends[:, :, :2].min(0), ends[:, :, 2:].max(0)
    inside = np.all((low >= 0) & (high <= np.array(view.camera.size) - 1), axis=1)
    body = ends[1]
    with np.errstate(invalid="ignore"):
        meets = np.all((low[:, None] < body[None, :, 2:]) & (high[:, None] > body[None, :, :2]), axis=2)
    np.fill_diagonal(meets, False)
    return np.asarray(inside & ~meets.any(axis=1))


def _by_pixels(people: Candidates, j: int, right: Floats, view: PixelView, sight: ViewObservation) -> float:
    """Where the pixels see one person, metres to the right of their place."""
    count = len(_SHIFTS)
    places = people.ground[j] + _SHIFTS[:, None] * right
    heights, widths = np.full(count, people.height[j]), np.full(count, people.width[j])
    nobodys = np.full(view.shape, -1, np.int64)
    sums, area = view.open_sums(sight.raster, nobodys, places[None], heights[None], widths[None])
    score = sums[0] / np.maximum(area[0], 1.0)
    weight = np.exp(score - score.max())
    return float(weight @ _SHIFTS / weight.sum())
