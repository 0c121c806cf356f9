"""The decisions of a run in the order of doubt: by what solving identities with the opposite decision loses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from stseg.engine.offline.known import rows_with_ids
from stseg.engine.pipeline import identity_problem
from stseg.identities.review.answered_constraints import answered_rows
from stseg.identities.review.corrections import Answer
from stseg.identities.review.doubts import Doubt, find_doubts
from stseg.identities.search.costs import CONTRADICTION
from stseg.io.config_file import parse_config
from stseg.io.runfile.runs import Run
from stseg.tasks.correction import answered_before, is_solved_again

_AROUND = 10.0
"""Time before and after a decision in which identities are solved with it, and with the opposite one, seconds."""
_HYPOTHESES = 50
"""Hypotheses of these searches."""
_WEIGHED_DECISIONS = 300
"""Decisions that are weighed so, those with the least margins by heights and motion alone; the others come after."""


def doubtful_decisions(run: Run) -> list[Doubt]:
    """Doubtful decisions of a run, the most doubtful first; without those that were answered before."""
    if not len(run.trajectory):
        return []
    grid = run.recording.rig.grid
    border = np.array([[grid.x[0], grid.y[0]], [grid.x[1], grid.y[1]]])
    found = find_doubts(run.trajectory, run.tracks, run.frame_rate, border)
    if not is_solved_again(run):
        return found
    weighed = sorted(_weighed(run, found[:_WEIGHED_DECISIONS]), key=lambda one: (one.margin, one.first, one.track))
    return weighed + found[_WEIGHED_DECISIONS:]


def _weighed(run: Run, doubts: Sequence[Doubt]) -> list[Doubt]:
    """Doubts whose margin is the loss of the opposite decision, nats."""
    rows, before = rows_with_ids(run), answered_before(run)
    kept, constraints = before.kept
    config = parse_config(run.provenance.config, f"{run.path}: configuration")
    rig = run.recording.reduced(config.foreground.body_rows).reduced_rig
    problem = identity_problem(rig, config, run.committed[kept], run.appearance, constraints)
    problem = problem.with_hypotheses(_HYPOTHESES)

    def score(doubt: Doubt, answer: Answer) -> float:
        _, bound = (before + answered_rows(rows, [answer], run.frame_rate)).kept
        since, until = doubt.first / run.frame_rate - _AROUND, doubt.last / run.frame_rate + _AROUND
        return problem.score(bound, since, until)

    def weighed(doubt: Doubt) -> Doubt:
        answers = _decisions(doubt)
        if answers is None or not len(answered_rows(rows, [answers[1]], run.frame_rate).constraints):
            return doubt
        return replace(doubt, margin=score(doubt, answers[0]) - score(doubt, answers[1]))

    return [one for one in map(weighed, doubts) if one.margin < CONTRADICTION / 2]


def _decisions(doubt: Doubt) -> tuple[Answer, Answer] | None:
    """The decision and its opposite; None where they bind nothing."""
    frame = (doubt.first + doubt.last + 1) // 2
    keep = Answer("", "keep", doubt.track, doubt.other, frame)
    if doubt.question in ("encounter", "birth"):
        return keep, Answer("", "swap", doubt.track, doubt.other, frame)
    return (keep, Answer("", "join", doubt.track, doubt.other)) if doubt.question == "gap" else None
