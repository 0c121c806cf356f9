"""The pass of one frame: candidates, and the set of them that best explains what all views show (METHODS 7).

Candidates are sought on a ground lattice, in what nobody explains yet, so people behind others are found once those
others stand. Whom the frames before led to expect are candidates too, and a newcomer away from the border costs. After
each round the set is searched anew, until a round changes nobody.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Boxes, Flags, Floats, Ints, Singles
from stseg.config import GhostConfig
from stseg.geometry import Rig
from stseg.ghosts.border import Border
from stseg.ghosts.evidence import Case, Terms
from stseg.ghosts.expected import Expected, nobody
from stseg.ghosts.pool import Pool, box_evidence, peaks, pixel_evidence
from stseg.ghosts.refine import owned, refine
from stseg.ghosts.scoring import box_score, pixel_score, set_score, walker_score
from stseg.ghosts.search import search
from stseg.ghosts.views import BoxView, PixelView, Sight, View

ViewEvidence = Boxes | Singles | None
"""One view of one frame: boxes, a likelihood map float32 (v, u), or None where the view is blind."""


@dataclass(frozen=True)
class People:
    """Places of bodies.

    Attributes
    ----------
    ground : float64 (n, 2)
        Metres.
    height : float64 (n,)
        Metres.
    covariance : float64 (n, 2, 2)
        Square metres.
    evidence : float64 (n,)
        What all views and the prior say, nats.
    parts : float64 (view, n)
        What each view says, nats.
    visible : float64 (view, n)
        How much of each body a view can see past nearer people, 0..1.
    prior : float64 (n,)
        What of the evidence spoke before any view was asked, nats.
    walker : int64 (n,)
        Whom of those expected each is, -1 for newcomers.
    """

    ground: Floats
    height: Floats
    covariance: Floats
    evidence: Floats
    parts: Floats
    visible: Floats
    prior: Floats
    walker: Ints

    def __len__(self) -> int:
        return len(self.ground)


@dataclass(frozen=True)
class Explanation:
    """Who is there, who is not, and who explains what.

    Attributes
    ----------
    people
        The true candidates.
    ghosts
        Candidates that were weighed and found to be nobody.
    owner : tuple of int16 arrays (v, u)
        For each view the index of the person whose body is nearest at each raster pixel, -1 for nobody.
    raster_step : tuple of int
        Image pixels to a raster pixel of `owner`, for each view.
    box_owner : tuple of int64 arrays (box,)
        For each view with boxes the person whom each box shows, -1 for nobody; empty for other views.
    """

    people: People
    ghosts: People
    owner: tuple[NDArray[np.int16], ...]
    raster_step: tuple[int, ...]
    box_owner: tuple[Ints, ...]


class FramePass:
    """The pass for one rig: lattice and tables are made once, frames are explained one by one.

    Parameters
    ----------
    rig
        The cameras and the grid.
    kinds
        What each camera delivers: "boxes" or "pixels".
    config
        The pass's constants.
    """

    def __init__(self, rig: Rig, kinds: Sequence[str], config: GhostConfig) -> None:
        self.config = config
        grid = rig.grid
        x = np.arange(grid.x[0] + config.lattice / 2, grid.x[1], config.lattice)
        y = np.arange(grid.y[0] + config.lattice / 2, grid.y[1], config.lattice)
        self.lattice_ground = np.stack(np.meshgrid(x, y), -1)
        flat = self.lattice_ground.reshape(-1, 2)
        self.views: list[BoxView | PixelView] = [
            BoxView(camera, grid, flat, config) if kind == "boxes" else PixelView(camera, grid, flat, config)
            for camera, kind in zip(rig.cameras, kinds, strict=True)
        ]
        self.terms = Terms(
            config.person,
            config.apart,
            config.hit,
            config.box_miss,
            config.hidden_below,
            config.whole_above,
            config.least,
            config.body_weight,
        )
        self.height_prior = self._height_prior(np.asarray(config.heights))
        self.border = Border.of(rig)

    def explain(self, seen: Sequence[ViewEvidence], expected: Expected | None) -> Explanation:
        """Explain one frame.

        Parameters
        ----------
        seen
            What each view shows.
        expected
            Whom the frames before lead to expect; None in a first frame, in which nobody is a newcomer.
        """
        sights = [None if s is None else view.observe(s) for view, s in zip(self.views, seen, strict=True)]
        prior = _Prior(
            expected or nobody(), self.config, self.border, 0.0 if expected is None else self.config.newcomer
        )
        frame = _Frame(self, sights, prior, pool := prior.pool(), np.arange(len(pool)))
        for _ in range(self.config.rounds):
            fresh = self._fresh(frame)
            moved = frame.refined()[0]
            if not len(fresh) and not len(moved):
                break
            known = len(frame.pool)
            frame = _Frame(self, sights, prior, frame.pool.and_(moved).and_(fresh), frame.members)
            if (frame.members < known).all():
                break
        return self._settled(frame).explanation()

    def _settled(self, frame: _Frame) -> _Frame:
        """The frame searched once more from where its people exactly stand, which may show two of them to be one."""
        exact = frame.refined()[0]
        known = len(frame.pool)
        return _Frame(self, frame.sights, frame.prior, frame.pool.and_(exact), np.arange(known, known + len(exact)))

    def _fresh(self, frame: _Frame) -> Pool:
        """Candidates in what nobody explains yet."""
        score = np.repeat(self.height_prior[:, None], len(self.lattice_ground.reshape(-1, 2)), 1)
        for view, sight, free in zip(self.views, frame.sights, frame.free(), strict=True):
            if sight is not None:
                score += view.lattice_score(sight, free)
        return peaks(score.reshape(-1, *self.lattice_ground.shape[:2]), self.lattice_ground, self._heights)

    @property
    def _heights(self) -> Floats:
        return np.asarray(self.config.heights)

    def _height_prior(self, heights: Floats) -> Floats:
        return -0.5 * ((heights - self.config.height_mean) / self.config.height_spread) ** 2


@dataclass(frozen=True)
class _Prior:
    """What is known of a frame before any view is asked: whom to expect, and what a newcomer costs inside."""

    expected: Expected
    config: GhostConfig
    border: Border
    cost: float

    def pool(self) -> Pool:
        """Those expected inside the border, as candidates: who leaves the area is not followed out of it."""
        heights, inside = self.config.heights, self.border.away(self.expected.ground) > 0
        return Pool(self.expected.ground[inside], self.expected.height[inside].clip(min(heights), max(heights)))

    def newcomer(self, pool: Pool) -> Floats:
        """What each candidate costs as a newcomer, nats, float64 (n,)."""
        return self.cost * np.minimum(self.border.away(pool.ground) / self.config.border, 1.0)

    def known(self, pool: Pool) -> Floats:
        """What speaks for each candidate by being each walker, nats, float64 (n, walker)."""
        return self.expected.known(pool.ground, pool.height, self.config)


class _Frame:
    """One frame while it is being explained: its candidates, and the set that explains it best."""

    def __init__(
        self, frame_pass: FramePass, sights: list[Sight | None], prior: _Prior, pool: Pool, members: Ints
    ) -> None:
        self.frame_pass, self.sights, self.prior, self.pool = frame_pass, sights, prior, pool
        views = frame_pass.views
        boxes, pixels = box_evidence(views, sights, pool), pixel_evidence(views, sights, pool)
        owner = np.empty(max(pixels.raster[:1].size, boxes.match.shape[2], len(prior.expected), 1), np.int64)
        parts = np.zeros((len(views), len(pool) + 1))
        own = frame_pass._height_prior(pool.height)
        newcomer, known = prior.newcomer(pool), prior.known(pool)
        self.case = Case(boxes, pixels, own, newcomer, known, pool.ground, frame_pass.terms, owner, parts)
        # The scores' parts have the views with boxes first; `row` finds those of each view of the rig.
        pixels_last = np.argsort([isinstance(view, PixelView) for view in views], kind="stable")
        self.row = np.argsort(pixels_last)
        room = np.zeros(len(pool) + 1, np.int64)
        room[: len(members)] = members
        count = search(room, len(members), self.case)
        self.members = room[:count].copy()
        self.box_owner, self.pixel_owner = self._owners()
        self.walker = self._walkers()

    def score(self, members: Ints) -> float:
        """Score of a set; the case's `parts` then holds what each view says of each member."""
        return set_score(members, len(members), self.case)

    def _owners(self) -> tuple[list[Ints], list[Ints]]:
        """For each view whose boxes are whose, and whose pixels are whose; -1 for nobody."""
        boxes, pixels = [], []
        case, count = self.case, len(self.members)
        box_view = pixel_view = 0
        for view, sight in zip(self.frame_pass.views, self.sights, strict=True):
            owner = np.full(len(sight.edges) if sight else 0, -1, np.int64)
            raster = np.full(view.shape, -1, np.int64)
            if isinstance(view, BoxView):
                box_score(box_view, self.members, count, case.boxes, case.terms, case.owner, case.parts[0])
                owner[:] = case.owner[: len(owner)]
                box_view += 1
            else:
                pixel_score(pixel_view, self.members, count, case.pixels, case.terms, case.owner, case.parts[0])
                rows, columns = case.pixels.raster.shape[1:]
                raster[:] = case.owner[: rows * columns].reshape(rows, columns)[: view.shape[0], : view.shape[1]]
                pixel_view += 1
            boxes.append(owner)
            pixels.append(raster)
        return boxes, pixels

    def _walkers(self) -> Ints:
        """Which walker each member is, int64 (member,), -1 for newcomers."""
        case, walker = self.case, np.full(len(self.members), -1, np.int64)
        walker_score(self.members, len(self.members), case.known, case.newcomer, case.owner)
        for k, place in enumerate(case.owner[: case.known.shape[1]]):
            if place >= 0:
                walker[place] = k
        return walker

    def _own_prior(self, candidates: Ints, walker: Ints) -> Floats:
        """What speaks for candidates before any view is asked, nats, float64 (n,)."""
        case = self.case
        alone = case.terms.person + case.own[candidates]
        return np.array(
            [
                p + (case.known[i, k] if k >= 0 else -case.newcomer[i])
                for p, i, k in zip(alone, candidates, walker, strict=True)
            ]
        )

    def _visible(self) -> Floats:
        """How much of each member each view can see past the others, float64 (view, member)."""
        visible = np.ones((len(self.frame_pass.views), len(self.members)))
        boxes = iter(range(len(self.case.boxes.match)))
        for row, view in zip(visible, self.frame_pass.views, strict=True):
            if isinstance(view, BoxView):
                k = next(boxes)
                cover = self.case.boxes.cover[k][np.ix_(self.members, self.members)]
                row[:] = view.found_share(self.case.boxes.inside[k][self.members] * np.prod(1.0 - cover, axis=1))
        return visible

    def free(self) -> list[Flags]:
        """For each view the boxes, or the pixels, that nobody explains."""
        return [
            (pixels if isinstance(view, PixelView) else boxes) < 0
            for view, boxes, pixels in zip(self.frame_pass.views, self.box_owner, self.pixel_owner, strict=True)
        ]

    def refined(self) -> tuple[Pool, Floats]:
        """The set's people at the means of their posteriors, and the covariances."""
        views = self.frame_pass.views
        own = [
            [owned(v, j, b, p) for v, b, p in zip(views, self.box_owner, self.pixel_owner, strict=True)]
            for j in range(len(self.members))
        ]
        people, expected = self.pool.at(self.members), self.prior.expected
        return refine(people, views, self.sights, own, self.frame_pass.height_prior, expected, self.walker)

    def explanation(self) -> Explanation:
        """The result, once nothing changes any more."""
        exact, covariance = self.refined()
        total = self.score(self.members)
        parts = self.case.parts[self.row, : len(self.members)]
        without = [self.score(np.delete(self.members, a)) for a in range(len(self.members))]
        evidence = total - np.array(without)
        people = People(
            exact.ground, exact.height, covariance, evidence, parts, self._visible(),
            self._own_prior(self.members, self.walker), self.walker,
        )  # fmt: skip
        views = self.frame_pass.views
        painted = [
            p if isinstance(v, PixelView) else _painted(v, exact) for v, p in zip(views, self.pixel_owner, strict=True)
        ]
        owner = tuple(p.astype(np.int16) for p in painted)
        return Explanation(people, self._ghosts(total), owner, tuple(v.step for v in views), tuple(self.box_owner))

    def _ghosts(self, total: float) -> People:
        """Candidates that were weighed and found to be nobody, those in the same place as a better one left out."""
        weighed = []
        for i in np.setdiff1d(np.arange(len(self.pool)), self.members):
            gain = self.score(np.append(self.members, i)) - total
            weighed.append((gain, i, self.case.parts[self.row, len(self.members)]))
        weighed.sort(key=lambda one: (-one[0], one[1]))
        kept: list[tuple[float, int, Floats]] = []
        standing = list(self.pool.ground[self.members])
        for gain, i, parts in weighed:
            place = self.pool.ground[i]
            if all(np.hypot(*(place - other)) >= 2 * self.frame_pass.config.lattice for other in standing):
                standing.append(place)
                kept.append((gain, int(i), parts))
        chosen = self.pool.at([i for _, i, _ in kept])
        wide = np.tile(np.eye(2) * self.frame_pass.config.lattice**2 / 12, (len(kept), 1, 1))
        parts = np.array([p for _, _, p in kept]).reshape(len(kept), len(self.frame_pass.views)).T
        strangers = np.full(len(kept), -1, np.int64)
        prior = self._own_prior(np.array([i for _, i, _ in kept], np.int64), strangers)
        evidence = np.array([gain for gain, _, _ in kept])
        return People(chosen.ground, chosen.height, wide, evidence, parts, np.ones_like(parts), prior, strangers)


def _painted(view: View, people: Pool) -> Ints:
    """Whose body is nearest at each raster pixel of a view, int64 (v, u), -1 for nobody."""
    first, spans, _ = view.outlines(people.ground, people.height)
    owner = np.full(view.shape, -1, np.int64)
    for j in np.argsort(-view.distance(people.ground), kind="stable"):
        for k in range(spans.shape[1]):
            if first[j] >= 0 and first[j] + k < view.shape[0]:
                owner[first[j] + k, spans[j, k, 0] : spans[j, k, 1]] = j
    return owner
