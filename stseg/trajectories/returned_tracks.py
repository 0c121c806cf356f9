"""Tracks of people who come back: one identity for all visits, which the events tell."""

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Ints, Rows
from stseg.identities.association import IdentityProblem
from stseg.identities.evidence.returns import Return, find_returns
from stseg.identities.search.constraints import Constraints
from stseg.records.tables import EVENT


def returns_of(
    problem: IdentityProblem, identity: Ints, frame: Ints, least: float, constraints: Constraints, known_people: Rows
) -> list[Return]:
    """Visits that are one person's with an earlier one.

    Parameters
    ----------
    problem
        By which identities were decided.
    identity : int64 (n,)
        Of each committed row, 0 for none: the first of those of the problem.
    frame : int64 (n + m,)
        Of each row of the problem.
    least
        Least probability.
    constraints
        Pairs of rows that are one person, or two.
    known_people : KNOWN_PERSON (k,)
        People of earlier recordings; no other person has their ids.
    """
    visits = problem.visits(np.pad(identity, (0, len(frame) - len(identity))), frame, known_people)
    two = [identity[rows[~constraints.same]] for rows in (constraints.earlier, constraints.later)]
    return find_returns(visits, problem.model.spread, least, np.column_stack(two))


def renamed_ids(ids: Ints, returns: Sequence[Return]) -> Ints:
    """Ids of visits as those of their people."""
    visit, identity = np.array(sorted((one.visit, one.identity) for one in returns), np.int64).reshape(-1, 2).T
    at = np.searchsorted(visit, ids).clip(max=len(visit) - 1)
    return np.where(visit[at] == ids, identity[at], ids)


def renamed_trajectory(trajectory: Rows, returns: Sequence[Return]) -> Rows:
    """A trajectory under the ids of people, sorted by frame, then id."""
    named = trajectory.copy()
    named["id"] = renamed_ids(trajectory["id"], returns)
    return np.asarray(named[np.lexsort((named["id"], named["frame"]))])


def renamed_events(events: Rows, trajectory: Rows, returns: Sequence[Return], frame_rate: float) -> Rows:
    """Events under the ids of people, and their returns; between visits there is neither birth nor death,
    nor is it in doubt whether they are one person's.

    Parameters
    ----------
    events : EVENT (m,)
    trajectory : TRAJECTORY (n,)
        Under the ids of people.
    frame_rate
        Frames per second.
    """
    named = events.copy()
    here = np.isin(events["id"], [name for one in returns for name in (one.visit, one.identity)])
    for role in ("id", "other"):
        named[role] = renamed_ids(events[role], returns)
    ids, start = np.unique(trajectory["id"], return_index=True)
    first = trajectory["frame"][start]
    last = np.zeros(len(ids), np.int64)
    np.maximum.at(last, np.searchsorted(ids, trajectory["id"]), trajectory["frame"])
    person = np.searchsorted(ids, named["id"]).clip(max=len(ids) - 1)
    between = here & (
        ((named["kind"] == b"birth") & (named["frame"] > first[person]))
        | ((named["kind"] == b"death") & (named["frame"] < last[person]))
        | ((named["kind"] == b"doubt") & (named["id"] == named["other"]))
    )
    came = [(one.frame, b"return", one.identity, 0, _reason(one, frame_rate).encode()) for one in returns]
    joined = np.concatenate([named[~between], np.array(came, EVENT)])
    return np.asarray(joined[np.argsort(joined["frame"], kind="stable")])


def _reason(one: Return, frame_rate: float) -> str:
    since = f"{one.absence / frame_rate:.1f} s away" if one.absence is not None else "known from an earlier recording"
    return f"the same person with probability {min(one.probability, 0.9999):.4f}, {since}"
