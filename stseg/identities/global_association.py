"""Global association: identities of all rows of a run, and where they differ from the filter's tracks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Ints, Rows
from stseg.config import Config
from stseg.identities.evidence.size_model import MeasuredSizes
from stseg.identities.identity_problem import IdentityProblem
from stseg.identities.search.beam_search import FREELY
from stseg.identities.search.constraints import Constraints
from stseg.records.border import Border
from stseg.records.rows_of_tracks import rows_of_tracks

_AROUND = 0.5
"""Time before and after a row in which its identity holds one track, seconds."""


@dataclass(frozen=True)
class Link:
    """A track that continues under the identity of another.

    Attributes
    ----------
    frame
        First frame under that identity.
    identity, track
        The identity that it takes, and its own number.
    reason
        In words.
    """

    frame: int
    identity: int
    track: int
    reason: str


@dataclass(frozen=True)
class GlobalAssociation:
    """Identities of a whole run.

    Attributes
    ----------
    identity : int64 (row,)
        Of each row of the trajectory.
    links
        Where they differ from the filter tracks.
    problem
        What they were decided by.
    """

    identity: Ints
    links: list[Link]
    problem: IdentityProblem


def associate_globally(
    trajectory: Rows, sizes: MeasuredSizes, appearance: Rows, frame_rate: float, border: Border, config: Config,
    constraints: Constraints = FREELY,
) -> GlobalAssociation:  # fmt: skip
    """Identities from the whole run.

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
        Pairs of rows that are one person, or two.
    """
    problem = IdentityProblem.of(trajectory, sizes, appearance, frame_rate, border, config, constraints)
    first = problem.solve(constraints)
    identity = _numbered(trajectory, first)
    return GlobalAssociation(identity, _links(trajectory, identity, frame_rate), problem)


def _numbered(trajectory: Rows, first: Ints) -> Ints:
    """Numbers of identities: that of the track in which each begins, or a new one where that is taken."""
    number, fresh = dict[int, int](), int(trajectory["id"].max(initial=0))
    taken = set[int]()
    begins = np.unique(first)
    for row in begins[np.lexsort((trajectory["id"][begins], trajectory["frame"][begins]))].tolist():
        own = int(trajectory["id"][row])
        if own in taken:
            fresh += 1
            own = fresh
        taken.add(own)
        number[row] = own
    return np.array([number[row] for row in first.tolist()], np.int64)


def _links(trajectory: Rows, identity: Ints, frame_rate: float) -> list[Link]:
    """Rows from which on an identity holds another track.

    Who stand together may be exchanged for single frames; what counts is the track that is held in most of the frames
    around.
    """
    links = []
    for own in rows_of_tracks(identity):
        rows, name = trajectory[own[np.argsort(trajectory["frame"][own])]], int(identity[own[0]])
        held = int(rows["id"][0])
        for k, track in enumerate(_mostly_held(rows, _AROUND * frame_rate).tolist()):
            if track != held and track == rows["id"][k]:
                links.append(_link(rows[k - 1], rows[k], name, frame_rate))
                held = track
    return sorted(links, key=lambda link: (link.frame, link.track))


def _mostly_held(rows: Rows, reach: float) -> Ints:
    """The track of most rows (n,) of one identity within some frames of each; its own where two have as many."""
    first = np.searchsorted(rows["frame"], rows["frame"] - reach)
    stop = np.searchsorted(rows["frame"], rows["frame"] + reach, "right")
    mostly = rows["id"].copy()
    for own in rows_of_tracks(rows["id"]):
        near = slice(first[own[0]], stop[own[-1]])
        among = np.searchsorted(own, stop[near]) - np.searchsorted(own, first[near])
        mostly[near][2 * among > stop[near] - first[near]] = rows["id"][own[0]]
    return np.asarray(mostly)


def _link(before: np.void, after: np.void, identity: int, frame_rate: float) -> Link:
    seconds = (after["frame"] - before["frame"]) / frame_rate
    away = float(np.hypot(after["x"] - before["x"], after["y"] - before["y"]))
    reason = f"{seconds:.1f} s on, {away:.2f} m away, {before['height']:.2f} and {after['height']:.2f} m tall"
    return Link(int(after["frame"]), identity, int(after["id"]), reason)
