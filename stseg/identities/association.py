"""Global association: the identities of all rows of a run, and where they differ from the filter's tracks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from stseg.arrays import Ints, Rows
from stseg.config import Config, MotionConfig
from stseg.identities.evidence.appearance_axes import Axes
from stseg.identities.evidence.appearance_model import LearnedAppearance, learn_appearance, row_looks
from stseg.identities.evidence.observations import Observations, observe
from stseg.identities.evidence.returns import Visits, pooled_visits
from stseg.identities.evidence.size_model import SizeModel, learn_heights
from stseg.identities.search.beam_search import SearchLimits, search_identities
from stseg.identities.search.constraints import NO_CONSTRAINTS, Constraints
from stseg.records.border import Border
from stseg.records.tables import KNOWN_PERSON
from stseg.tracking.row_groups import isolated_tracklets, rows_of_tracks

_DRAFT_DIVISOR = 4
"""Divisor of the number of hypotheses in the draft search; appearance is learned from its identities."""
NO_KNOWN_PEOPLE: Rows = np.zeros(0, KNOWN_PERSON)
"""No people of earlier recordings."""


@dataclass(frozen=True)
class IdentityProblem:
    """Observations of a run, statistics of sizes and appearance, and the limits of the search."""

    observations: Observations
    """The rows in the order of time."""
    model: SizeModel
    """Statistics of sizes and appearance."""
    motion: MotionConfig
    """Motion model."""
    limits: SearchLimits
    """Extent of the search."""
    frame_rate: float
    """Frames per second."""
    colours: Axes | None = None
    """The last axes of the model: those of colours; None where there are none."""

    @classmethod
    def of(
        cls,
        trajectory: Rows,
        appearance: Iterable[Rows],
        frame_rate: float,
        border: Border,
        config: Config,
        constraints: Constraints = NO_CONSTRAINTS,
    ) -> IdentityProblem:
        """The problem of a run; sizes and appearance are learned from it.

        `trajectory` is TRAJECTORY (n,) in any order, `appearance` are parts, APPEARANCE (l,) each (`row_means`).
        `frame_rate` is in frames per second; people come and go at the border. The constraints are pairs of rows that
        are one person, or two: identities from which appearance is learned obey them.
        """
        tracklets, tracking = isolated_tracklets(trajectory, frame_rate), config.tracking
        limits = SearchLimits(tracking.hypotheses, tracking.maximum_gap, tracking.identity_lag)
        height = trajectory["height"].astype(float)
        heights = learn_heights(height, trajectory["frame"], tracklets, frame_rate, config)

        def problem(learned: LearnedAppearance) -> IdentityProblem:
            joined = SizeModel.joined([heights, learned.model])
            columns = [height, *learned.value.T]
            observations = observe(trajectory, columns, joined, frame_rate, border, config)
            return cls(observations, joined, config.motion, limits, frame_rate, learned.colours)

        def draft_appearance() -> LearnedAppearance:
            """Appearance by the identities of a draft; nothing where no detection has any."""
            appearances = row_looks(trajectory, appearance)
            if not any(np.isfinite(value[:, 0]).any() for value in appearances):
                return LearnedAppearance.nothing(len(trajectory))
            by = partial(learn_appearance, trajectory["frame"], appearances, tracklets, frame_rate=frame_rate)
            # Tracklets are right, but appearance outlasts them; identities last, and with appearance few are wrong.
            drafted = -(-tracking.hypotheses // _DRAFT_DIVISOR)
            return by(problem(by(_tracklet_of(tracklets))).with_hypotheses(drafted).solve(constraints))

        return problem(draft_appearance())

    def with_hypotheses(self, number: int) -> IdentityProblem:
        """The problem with another number of hypotheses."""
        return replace(self, limits=replace(self.limits, hypotheses=number))

    def solve(self, constraints: Constraints = NO_CONSTRAINTS) -> Ints:
        """The first row of the identity of each row, int64 (n,)."""
        order, first = self.observations.order, np.empty(len(self.observations.order), np.int64)
        bound = constraints.renumbered(self.observations.number)
        first[order] = order[search_identities(self.observations, self.model, self.motion, self.limits, bound).name]
        return first

    def visits(self, identity: Ints, frame: Ints, earlier: Rows = NO_KNOWN_PEOPLE) -> Visits:
        """Sums of sizes and appearance over the visit of each identity, after those of people of earlier recordings.

        `identity` and `frame` int64 (n,) are those of each row, identity 0 for none; `earlier` KNOWN_PERSON (k,) are
        the people of earlier recordings.
        """
        order, rows = self.observations.order, self.observations.rows
        visits = pooled_visits(identity[order], frame[order], rows.precision, rows.information)
        value = np.full((len(earlier), len(self.model.spread)), np.nan)
        number = np.zeros(value.shape)
        value[:, 0], number[:, 0] = earlier["height"], earlier["height_count"]
        if self.colours is not None and len(earlier):
            axes = self.colours.of(earlier["colours"])
            first = value.shape[1] - axes.shape[1]
            value[:, first:], number[:, first:] = axes, earlier["appearance_count"][:, None]
        precision, information = self.model.evidence([*value.T])
        return visits.after(earlier["id"], number * precision, number * information)

    def score(self, constraints: Constraints, chosen: Ints, left_out: Ints, stand_in: Ints) -> float:
        """Score of the best identities of some rows of the trajectory alone, int64 (k,), rising: nats.

        Constraints are pairs of rows; those of which a row is not chosen are left out. The size evidence of rows that
        are `left_out`, int64 (m,), counts for those that stand in for them, int64 (m,).
        """
        number = self.observations.number
        part = self.observations.at(np.sort(number[chosen]), number[left_out], number[stand_in])
        place = np.full(len(number), -1)
        place[part.order] = np.arange(len(part.order))
        bound = constraints.renumbered(place).among()
        return search_identities(part, self.model, self.motion, self.limits, bound).score


def _tracklet_of(tracklets: Sequence[Ints]) -> Ints:
    """The first row of the tracklet of each row."""
    first = np.empty(sum(map(len, tracklets)), np.int64)
    for rows in tracklets:
        first[rows] = rows[0]
    return first


_LINK_WINDOW = 0.5
"""Time before and after a row in which the prevailing track of its identity is counted, seconds."""


@dataclass(frozen=True)
class Link:
    """A track that continues under the identity of another."""

    frame: int
    """First frame under that identity."""
    identity: int
    """The identity."""
    track: int
    """Number of the track."""
    reason: str
    """In words."""


@dataclass(frozen=True)
class GlobalAssociation:
    """Identities of a whole run."""

    identity: Ints
    """int64 (row,): identity of each row of the trajectory."""
    links: list[Link]
    """Where they differ from the filter tracks."""


def associate_globally(
    trajectory: Rows, problem: IdentityProblem, constraints: Constraints = NO_CONSTRAINTS
) -> GlobalAssociation:
    """Identities of the rows of a trajectory by their problem, under constraints on them."""
    identity = _numbered(trajectory, problem.solve(constraints))
    return GlobalAssociation(identity, _links(trajectory, identity, problem.frame_rate))


def _numbered(trajectory: Rows, first: Ints) -> Ints:
    """Numbers of identities: that of the track in which each begins, or a new one where another has that."""
    number, last_number, used = dict[int, int](), int(trajectory["id"].max(initial=0)), set[int]()
    begins = np.unique(first)
    for row in begins[np.lexsort((trajectory["id"][begins], trajectory["frame"][begins]))].tolist():
        number[row] = int(trajectory["id"][row])
        if number[row] in used:
            last_number += 1
            number[row] = last_number
        used.add(number[row])
    return np.array([number[row] for row in first.tolist()], np.int64)


def _links(trajectory: Rows, identity: Ints, frame_rate: float) -> list[Link]:
    """Rows from which on an identity holds another track.

    People who stand together may be exchanged for single frames, so the track of most of the frames around counts.
    """
    links = []
    for index in rows_of_tracks(identity):
        rows, name = trajectory[index[np.argsort(trajectory["frame"][index])]], int(identity[index[0]])
        current = int(rows["id"][0])
        for k, track in enumerate(_prevailing_track(rows, _LINK_WINDOW * frame_rate).tolist()):
            if track != current and track == rows["id"][k]:
                links.append(_link(rows[k - 1], rows[k], name, frame_rate))
                current = track
    return sorted(links, key=lambda link: (link.frame, link.track))


def _prevailing_track(rows: Rows, reach: float) -> Ints:
    """The track of most rows (n,) of one identity within some frames of each; its own where two have as many."""
    first = np.searchsorted(rows["frame"], rows["frame"] - reach)
    stop = np.searchsorted(rows["frame"], rows["frame"] + reach, "right")
    prevailing = rows["id"].copy()
    for index in rows_of_tracks(rows["id"]):
        around = slice(first[index[0]], stop[index[-1]])
        count = np.searchsorted(index, stop[around]) - np.searchsorted(index, first[around])
        prevailing[around][2 * count > stop[around] - first[around]] = rows["id"][index[0]]
    return np.asarray(prevailing)


def _link(before: np.void, after: np.void, identity: int, frame_rate: float) -> Link:
    seconds = (after["frame"] - before["frame"]) / frame_rate
    away = float(np.hypot(after["x"] - before["x"], after["y"] - before["y"]))
    heights = float(before["height"]), float(after["height"])
    tall = ", {:.2f} and {:.2f} m tall".format(*heights) if np.isfinite(heights).all() else ""
    return Link(int(after["frame"]), identity, int(after["id"]), f"{seconds:.1f} s on, {away:.2f} m away{tall}")
