"""The identities of a run as one problem: its observations, what sizes and appearance tell, and the search's limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stseg.arrays import Ints, Rows
from stseg.config import Config, MotionConfig
from stseg.identities.evidence.appearance_model import LearnedAppearance, learn_appearance, row_looks
from stseg.identities.evidence.discriminant_axes import Axes
from stseg.identities.evidence.observations import Observations, observe
from stseg.identities.evidence.size_model import MeasuredSizes, SizeModel, learn_sizes
from stseg.identities.evidence.visits import Visits, pooled_visits
from stseg.identities.search.beam_search import FREELY, SearchLimits, search_identities
from stseg.identities.search.constraints import Constraints
from stseg.records.border import Border
from stseg.records.tables import KNOWN
from stseg.tracking.windows.isolated_tracklets import isolated_tracklets

_DRAFT = 4
"""Share of the hypotheses, one in so many, of the search from whose identities appearance is learned."""
NOBODY: Rows = np.zeros(0, KNOWN)
"""Nobody who was known before."""


@dataclass(frozen=True)
class IdentityProblem:
    """Whose are the rows of a run?

    Attributes
    ----------
    seen
        The rows in the order of time.
    model
        Statistics of sizes and appearance.
    motion
        Motion model.
    limits
        Extent of the search.
    frame_rate
        Frames per second.
    colours
        The last axes of the model: those of colours; None where there are none.
    """

    seen: Observations
    model: SizeModel
    motion: MotionConfig
    limits: SearchLimits
    frame_rate: float
    colours: Axes | None = None

    @classmethod
    def of(
        cls, trajectory: Rows, sizes: MeasuredSizes, appearance: Rows, frame_rate: float, border: Border,
        config: Config, constraints: Constraints = FREELY,
    ) -> IdentityProblem:  # fmt: skip
        """The problem of a run; sizes and appearance are learned from it.

        Parameters
        ----------
        trajectory : TRAJECTORY (n,)
            In any order.
        sizes
            Of each row.
        appearance : APPEARANCE (l,)
            Of detections.
        frame_rate
            Frames per second.
        border
            Where people come and go.
        config
            The constants of all stages: body, motion, detection and tracking.
        constraints
            Pairs of rows that are one person, or two: identities from which appearance is learned obey them.
        """
        tracklets, own = isolated_tracklets(trajectory, frame_rate), config.tracking
        limits = SearchLimits(own.hypotheses, own.maximum_gap, own.identity_lag)
        model = learn_sizes(sizes, trajectory["frame"], tracklets, frame_rate)

        def problem(learned: LearnedAppearance) -> IdentityProblem:
            joined = SizeModel.joined([model, learned.model])
            value = np.concatenate([sizes.value, learned.value], axis=1)
            seen = observe(trajectory, value, joined, frame_rate, border, config)
            return cls(seen, joined, config.motion, limits, frame_rate, learned.colours)

        def learned(person: Ints) -> LearnedAppearance:
            return learn_appearance(trajectory["frame"], looks, tracklets, person, frame_rate)

        if not len(appearance):
            return problem(LearnedAppearance.nothing(len(trajectory)))
        looks = row_looks(trajectory, appearance)
        # Tracklets are right, but looks outlast them; identities last, and with appearance few are wrong.
        draft = problem(learned(_tracklet_of(tracklets))).with_hypotheses(-(-own.hypotheses // _DRAFT))
        return problem(learned(draft.solve(constraints)))

    def with_hypotheses(self, number: int) -> IdentityProblem:
        """The problem with another number of hypotheses."""
        return replace(self, limits=replace(self.limits, hypotheses=number))

    def solve(self, constraints: Constraints = FREELY) -> Ints:
        """The first row of the identity of each row, int64 (n,)."""
        order, first = self.seen.order, np.empty(len(self.seen.order), np.int64)
        known = constraints.renumbered(np.argsort(order))
        first[order] = order[search_identities(self.seen, self.model, self.motion, self.limits, known).name]
        return first

    def visits(self, identity: Ints, frame: Ints, known: Rows = NOBODY) -> Visits:
        """What sizes and appearance tell of identities, and of people who were known before.

        Parameters
        ----------
        identity, frame : int64 (n,)
            Of each row; identity 0 for none.
        known : KNOWN (k,)
            People of earlier recordings.
        """
        order = self.seen.order
        visits = pooled_visits(identity[order], frame[order], self.seen.precision, self.seen.information)
        value = np.full((len(known), len(self.model.spread)), np.nan)
        number = np.zeros(value.shape)
        value[:, 0], number[:, 0] = known["height"], known["heights"]
        if self.colours is not None and len(known):
            axes = self.colours.of(known["colours"])
            value[:, -axes.shape[1] :], number[:, -axes.shape[1] :] = axes, known["looks"][:, None]
        precision, information = self.model.evidence(value, self.frame_rate)
        return visits.after(known["id"], number * precision, number * information)

    def score(self, constraints: Constraints, since: float, until: float) -> float:
        """Score of the best identities of the rows between two times, nats.

        Parameters
        ----------
        constraints
            Pairs of rows; those of which a row lies outside are left out.
        since, until
            Seconds.
        """
        start, stop = np.searchsorted(self.seen.seconds, (since, until)).tolist()
        part = self.seen.between(start, stop)
        place = np.full(len(self.seen.order), -1)
        place[part.order] = np.arange(len(part.order))
        known = constraints.renumbered(place).among()
        return search_identities(part, self.model, self.motion, self.limits, known).score


def _tracklet_of(tracklets: Sequence[Ints]) -> Ints:
    """The first row of the tracklet of each row."""
    first = np.empty(sum(map(len, tracklets)), np.int64)
    for rows in tracklets:
        first[rows] = rows[0]
    return first
