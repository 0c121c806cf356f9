"""Decisions about identities, weighed against their opposites.

The identities of two people are solved by the rows of both alone, from some seconds before a decision until some after
it: once bound by the decision, once by its opposite. The difference of the two scores is the log-odds of the decision.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from stseg.arrays import Ints, Rows
from stseg.identities.association import IdentityProblem
from stseg.identities.review.answered_constraints import RowsOfTracks
from stseg.identities.review.corrections import Answer
from stseg.identities.review.doubts import Doubt, identity_doubts
from stseg.identities.search.constraints import Constraints
from stseg.identities.search.costs import CONTRADICTION
from stseg.records.tables import EVENT

DOUBT_LIMIT = 2.0
"""Log-odds of a decision below which a run calls it a doubt, nats: the opposite has a probability of 0.12 or more."""
_WEIGHED_BELOW = 1.0
"""Evidence of heights and motion alone above which a run takes a decision for certain, nats."""
_MOST_WEIGHED = 500
"""Decisions of a run that are weighed, those with the least of that evidence: each takes some milliseconds."""
_AROUND = 5.0
"""Time before and after a decision of which rows are evidence for it, seconds."""
_HYPOTHESES = 4
"""Joint hypotheses of two people that are kept."""


def weighed_doubts(
    doubts: Sequence[Doubt], rows: Rows, problem: IdentityProblem, constraints: Constraints
) -> list[Doubt]:
    """Doubts with the log-odds of their decisions as margins; none of those that constraints decide.

    Parameters
    ----------
    doubts
        Of tracks; those that are no question of identity stay as they are.
    rows : TRAJECTORY (n,)
        The first rows of the problem, under the ids of tracks, 0 for none.
    problem
        Identities of these rows.
    constraints
        Pairs of rows that are one person, or two.
    """
    tracks, pairwise = RowsOfTracks(rows, problem.frame_rate), problem.with_hypotheses(_HYPOTHESES)
    margins = [_margin(doubt, tracks, pairwise, constraints) for doubt in doubts]
    weighed = [replace(doubt, margin=margin) for doubt, margin in zip(doubts, margins, strict=True)]
    return [doubt for doubt in weighed if doubt.margin < CONTRADICTION / 2]


def doubt_events(trajectory: Rows, rows: Rows, problem: IdentityProblem, constraints: Constraints) -> Rows:
    """EVENT rows of the decisions of a run that nothing bears out; `trajectory` has its tracks, the rest as above."""
    found = sorted(identity_doubts(trajectory, problem.frame_rate), key=lambda one: one.margin)[:_MOST_WEIGHED]
    doubts = weighed_doubts([one for one in found if one.margin < _WEIGHED_BELOW], rows, problem, constraints)
    return np.array([_event(one) for one in doubts if one.margin < DOUBT_LIMIT], EVENT)


def _event(doubt: Doubt) -> tuple[int, bytes, int, int, bytes]:
    chance = f"{100 * doubt.chance:.0f} %"
    words = {
        "encounter": f"exchanged in this encounter with a probability of {chance}",
        "birth": f"with a probability of {chance} this track is from here on another person, and {doubt.other} is it",
        "gap": f"with a probability of {chance} {doubt.other} is the same person",
    }
    return doubt.frame, b"doubt", doubt.track, doubt.other, words[doubt.question].encode()


def _margin(doubt: Doubt, tracks: RowsOfTracks, problem: IdentityProblem, constraints: Constraints) -> float:
    """Log-odds of a decision, nats; the margin that it has where its opposite binds no rows."""
    decision, opposite = (Constraints.of(*tracks.pairs(answer)) for answer in _answers(doubt))
    if not len(opposite):
        return doubt.margin
    around = _Around.of(doubt, tracks, decision + opposite)
    one, other = (problem.score(constraints + bound, *around) for bound in (decision, opposite))
    return one - other


def _answers(doubt: Doubt) -> tuple[Answer, Answer]:
    """The decision and its opposite."""
    keep = Answer("", "keep", doubt.track, doubt.other, doubt.frame)
    if doubt.question == "gap":
        return keep, Answer("", "join", doubt.track, doubt.other)
    return keep, Answer("", "swap", doubt.track, doubt.other, doubt.frame)


class _Around(NamedTuple):
    """Rows of two tracks around a decision."""

    chosen: Ints
    """int64 (k,): from some time before until some time after it, and those that are bound."""
    left_out: Ints
    """int64 (m,): the others."""
    stand_in: Ints
    """int64 (m,): the first or last chosen row of the same track: sizes are those of a person at any time."""

    @classmethod
    def of(cls, doubt: Doubt, tracks: RowsOfTracks, bound: Constraints) -> _Around:
        """Those of a decision and its opposite, which bind rows."""
        frame, reach = tracks.rows["frame"], _AROUND * tracks.frame_rate
        named = frame[np.concatenate([bound.earlier, bound.later])]
        first, last = min(doubt.first - reach, named.min()), max(doubt.last + reach, named.max())
        parts = []
        for track in (doubt.track, doubt.other):
            rows, frames = tracks.of[track], tracks.frames[track]
            start, stop = int(np.searchsorted(frames, first)), int(np.searchsorted(frames, last, "right"))
            if start < stop:
                ends = np.repeat(rows[[start, stop - 1]], [start, len(rows) - stop])
                parts.append((rows[start:stop], np.concatenate([rows[:start], rows[stop:]]), ends))
        return cls(*map(np.concatenate, zip(*parts, strict=True)))
