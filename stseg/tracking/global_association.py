"""Global association: a minimum-cost flow over isolated tracklets (docs/how-it-works.md, Tracks).

Identity is uncertain in an encounter; afterwards motion and height decide. So every track is cut at its encounters and
gaps, and the tracklets are linked anew: each end to at most one later beginning, such that the sum over all links of

    log N(d; 0, s^2 I) + log N(h_a - h_b; 0, v_a + v_b) - log N(h_a - h_b; 0, 2 spread^2) + parted + [same] stays,
    d = x_b - x_a - t (v_a + v_b) / 2,   s^2 = 2 noise^2 + t^2 (var v_a + var v_b) / 4 + turn^2 t^3 / 12,

is greatest: the log-likelihood ratio of one person against two, one who ends here and one of any height who begins
there. An end and a beginning cost inside the area alone: people come and go at its border. A flow of one unit through
each tracklet is an assignment of ends to beginnings, so SciPy's exact solver finds it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from stseg.arrays import Floats, Ints, Rows
from stseg.config import Config
from stseg.model.border import Border
from stseg.tracking.assignment import assign
from stseg.tracking.isolated_tracklets import IsolatedTracklet, isolated_tracklets

_STAYS = 3.0
"""Log-likelihood ratio of the filter track, nats: it was followed through the encounter."""
_PARTED = 6.0
"""Cost of one end and one beginning, both inside the area, nats per square metre."""


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
    """

    identity: Ints
    links: list[Link]


def associate_globally(trajectory: Rows, frame_rate: float, border: Border, config: Config) -> GlobalAssociation:
    """Identities from the whole run.

    Parameters
    ----------
    trajectory : TRAJECTORY (n,)
        In any order.
    frame_rate
        Frames per second.
    border
        Where people come and go.
    config
        The constants of all stages: body, motion, detection and tracking.
    """
    parts = isolated_tracklets(trajectory, frame_rate, config.tracking, config.motion)
    pairs = _within_reach(parts, frame_rate, config)
    ends, begins = (
        border.inside(np.array([tip.ground for tip in tips]).reshape(-1, 2), config.detection.border_width)
        for tips in ([part.end for part in parts], [part.start for part in parts])
    )
    gain = np.array([_gain(parts[a], parts[b], frame_rate, config) for a, b in pairs])
    gain += _PARTED * (ends[pairs[:, 0]] + begins[pairs[:, 1]]) / 2
    before = _flow(len(parts), pairs[gain > 0], gain[gain > 0])
    identity, links, used = np.zeros(len(parts), np.int64), [], set[int]()
    fresh = int(trajectory["id"].max(initial=0))
    for p, part in enumerate(parts):
        if before[p] >= 0:
            identity[p] = identity[before[p]]
        elif part.track not in used:
            identity[p] = part.track
        else:
            fresh += 1
            identity[p] = fresh
        used.add(int(identity[p]))
        if before[p] >= 0 and parts[before[p]].track != part.track:
            links.append(_link(parts[before[p]], part, int(identity[p]), frame_rate))
    named = np.zeros(len(trajectory), np.int64)
    for p, part in enumerate(parts):
        named[part.rows] = identity[p]
    return GlobalAssociation(named, links)


def _flow(number: int, pairs: Ints, gain: Floats) -> Ints:
    """The tracklet that each one continues, int64 (number,), -1 for none: the pairs of greatest sum, group by group."""
    before = np.full(number, -1, np.int64)
    shape = (2 * number, 2 * number)
    joined = coo_array((np.ones(len(pairs)), (pairs[:, 0], number + pairs[:, 1])), shape=shape)
    group = connected_components(joined, directed=False)[1][pairs[:, 0]]
    for name in np.unique(group):
        own = group == name
        ends, row = np.unique(pairs[own, 0], return_inverse=True)
        begins, column = np.unique(pairs[own, 1], return_inverse=True)
        cost = np.full((len(ends), len(begins)), np.inf)
        cost[row, column] = -gain[own]
        a, b = assign(cost, 0.0)
        before[begins[b]] = ends[a]
    return before


def _within_reach(parts: Sequence[IsolatedTracklet], frame_rate: float, config: Config) -> Ints:
    """Pairs of a tracklet and one that begins later, within `tracking.maximum_gap` of its end: int64 (pair, 2)."""
    begins = np.array([part.start.frame for part in parts])
    pairs = []
    for a, part in enumerate(parts):
        end = part.end.frame
        first, stop = begins.searchsorted([end + 1, end + config.tracking.maximum_gap * frame_rate + 1])
        pairs += [(a, b) for b in range(first, stop)]
    return np.array(pairs, np.int64).reshape(-1, 2)


def _gain(a: IsolatedTracklet, b: IsolatedTracklet, frame_rate: float, config: Config) -> float:
    """Log-likelihood ratio of one person in both, without the cost of an end and a beginning, nats."""
    seconds, off = _between(a, b, frame_rate)
    velocity_variance = a.end.velocity_variance + b.start.velocity_variance
    spread = (
        2 * config.motion.position_noise**2
        + seconds**2 * velocity_variance / 4
        + config.motion.velocity_noise**2 * seconds**3 / 12
    )
    place = -0.5 * float(off @ off) / spread - np.log(2 * np.pi * spread)
    known, anybody = a.height_variance + b.height_variance, 2 * config.body.height_spread**2
    taller = (a.height - b.height) ** 2
    height = -0.5 * taller / known + 0.5 * taller / anybody + 0.5 * np.log(anybody / known)
    return float(place + height + (_STAYS if a.track == b.track else 0.0))


def _between(a: IsolatedTracklet, b: IsolatedTracklet, frame_rate: float) -> tuple[float, Floats]:
    """Seconds from the end of one to the start of another, and the distance from the extrapolation of both, (2,)."""
    seconds = (b.start.frame - a.end.frame) / frame_rate
    return seconds, b.start.ground - a.end.ground - seconds * (a.end.velocity + b.start.velocity) / 2


def _link(a: IsolatedTracklet, b: IsolatedTracklet, identity: int, frame_rate: float) -> Link:
    seconds, off = _between(a, b, frame_rate)
    reason = f"{seconds:.1f} s on, {np.hypot(*off):.2f} m off the way, {a.height:.2f} and {b.height:.2f} m tall"
    return Link(b.start.frame, identity, b.track, reason)
