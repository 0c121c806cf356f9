"""What a frame comes to once nothing changes any more: its people, its ghosts, and who explains what."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.detection.map_estimate import MapEstimate
from stseg.detection.residual import aside
from stseg.detection.views import BoxView, PixelView, View
from stseg.model.candidates import Candidates
from stseg.model.people import Explanation, People
from stseg.model.sizes import Sizes


def explanation(frame: MapEstimate) -> Explanation:
    """The result of a frame."""
    views, members = frame.seen.views, frame.members
    refined = frame.refined()
    exact = Candidates(refined.pool.ground, refined.known.height, refined.known.width)
    total = frame.score(members)  # which fills the parts
    parts = frame.case.parts[frame.row, : len(members)]
    without = [frame.score(np.delete(members, a)) for a in range(len(members))]
    people = People(
        exact.ground, exact.height, exact.width, refined.covariance, total - np.array(without), parts, _visible(frame),
        _prior(frame, members, frame.walker), frame.walker, refined.sizes,
    )  # fmt: skip
    painted = [
        p if isinstance(v, PixelView) else _painted(v, exact) for v, p in zip(views, frame.pixel_owner, strict=True)
    ]
    owner = tuple(p.astype(np.int16) for p in painted)
    told = aside(exact, views, frame.seen.sights, frame.box_owner)
    return Explanation(people, _ghosts(frame, total), owner, tuple(v.step for v in views), tuple(frame.box_owner), told)


def _prior(frame: MapEstimate, candidates: Ints, walker: Ints) -> Floats:
    """What speaks for candidates before any view is asked, nats, float64 (n,)."""
    case = frame.case
    alone = case.terms.person + case.own[candidates]
    return np.array(
        [
            p + (case.known[i, k] if k >= 0 else -case.newcomer[i])
            for p, i, k in zip(alone, candidates, walker, strict=True)
        ]
    )


def _visible(frame: MapEstimate) -> Floats:
    """How much of each member each view can see past the others, float64 (view, member)."""
    members, evidence = frame.members, frame.case.boxes
    visible = np.ones((len(frame.seen.views), len(members)))
    boxes = iter(range(len(evidence.match)))
    for row, view in zip(visible, frame.seen.views, strict=True):
        if isinstance(view, BoxView):
            k = next(boxes)
            cover = evidence.cover[k][np.ix_(members, members)]
            row[:] = view.found_share(evidence.inside[k][members] * np.prod(1.0 - cover, axis=1))
    return visible


def _ghosts(frame: MapEstimate, total: float) -> People:
    """The places that were weighed and found to be nobody's."""
    lattice = frame.seen.prior.config.lattice_spacing
    which = np.setdiff1d(np.arange(len(frame.pool)), frame.members)
    kept = []
    for i in which:
        gain = frame.score(np.append(frame.members, i)) - total
        kept.append((gain, frame.case.parts[frame.row, len(frame.members)]))
    chosen = frame.pool.at(which)
    wide = np.tile(np.eye(2) * lattice**2 / 12, (len(kept), 1, 1))
    parts = np.array([p for _, p in kept]).reshape(len(kept), len(frame.seen.views)).T
    strangers = np.full(len(kept), -1, np.int64)
    prior, evidence = _prior(frame, which, strangers), np.array([gain for gain, _ in kept])
    sizes = Sizes.of_population(len(kept), frame.seen.prior.body)
    return People(
        chosen.ground, chosen.height, chosen.width, wide, evidence, parts, np.ones_like(parts), prior, strangers, sizes
    )


def _painted(view: View, people: Candidates) -> Ints:
    """Whose body is nearest at each raster pixel of a view, int64 (v, u), -1 for nobody."""
    first, spans, _ = view.outlines(people.ground, people.height, people.width)
    owner = np.full(view.shape, -1, np.int64)
    for j in np.argsort(-view.distance(people.ground), kind="stable"):
        for k in range(spans.shape[1]):
            if first[j] >= 0 and first[j] + k < view.shape[0]:
                owner[first[j] + k, spans[j, k, 0] : spans[j, k, 1]] = j
    return owner
