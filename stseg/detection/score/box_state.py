"""Boxes of a set: the change of the box score with one more member, from the members linked to it alone.

One more member changes the score of a view for the members behind, for those who fit the same boxes, for those who fit
the boxes of these, and so on. They are few, so the boxes of a view are assigned anew among them alone.
"""

from typing import NamedTuple

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.detection.problem import BoxEvidence, RaggedArray, ScoreParameters, append, ragged_array
from stseg.detection.score.scoring import missing_box_cost
from stseg.kernels.accelerate import kernel, part


class BoxPairs(NamedTuple):
    """Scratch for the assignment of boxes: pairs of a member and a box, and boxes with a pair."""

    gain: Floats
    member: Ints
    box: Ints
    own_gain: Floats
    """float64 (candidate,): the gain of the box that each of the last linked members is assigned, 0 for none, nats."""
    own_box: Ints
    """int64 (candidate,): that box, -1 for none."""
    has_member: Flags


class BoxState(NamedTuple):
    """Links of the candidates through boxes; the row of a candidate in a view is view * candidates + candidate."""

    views: int
    """Number of views with boxes."""
    boxes: int
    """Most boxes of a view: the row of a box is view * boxes + box."""
    fits: RaggedArray
    """Boxes that a candidate may gain by, with the gain against no box at no cost, nats."""
    fitting: RaggedArray
    """The candidates of each box."""
    fitting_members: Ints
    """int64 (k,): the members of the set among the candidates of each box, rising, from the place of the first on."""
    members: Ints
    """int64 (view * box,): number of these of each box."""
    occluded: RaggedArray
    """Candidates that one hides in part, with the share that is left."""
    occluders: RaggedArray
    """Candidates who hide a part of one, with the share that they leave."""
    visible: Floats
    """float64 (view * candidate,): share of the candidate's pillar inside the image."""
    missing_cost: Floats
    """float64 (view * candidate,): cost of a missing box of a candidate that no member hides, nats."""
    linked: Ints
    """int64 (candidate + 1,): scratch, as are `is_linked` and `pairs`."""
    is_linked: Flags
    """bool (candidate,): no candidate is linked before and after."""
    pairs: BoxPairs


@kernel
def box_state(evidence: BoxEvidence, parameters: ScoreParameters) -> BoxState:
    """The links of all candidates."""
    views, candidates, boxes = evidence.match.shape
    threshold = np.log(parameters.box_miss_rate) - parameters.box_log_ratio
    fit, fitted = np.zeros(views * candidates, np.int64), np.zeros(views * boxes, np.int64)
    missing_cost = np.empty(views * candidates)
    for view in range(views):
        for i in range(candidates):
            row = view * candidates + i
            inside = evidence.inside[view, i]
            missing_cost[row] = missing_box_cost(inside, parameters) if inside > 0 else 0.0
            for b in range(evidence.boxes[view]):
                if evidence.match[view, i, b] > threshold:
                    fit[row] += 1
                    fitted[view * boxes + b] += 1
    (fits, fit), (fitting, fitted) = ragged_array(fit), ragged_array(fitted)
    for view in range(views):
        for i in range(candidates):
            for b in range(evidence.boxes[view]):
                if evidence.match[view, i, b] > threshold:
                    gain = parameters.box_log_ratio + evidence.match[view, i, b]
                    append(fits, fit, view * candidates + i, b, gain)
                    append(fitting, fitted, view * boxes + b, i, gain)
    most = len(fits.item) + 1
    pairs = BoxPairs(
        np.empty(most),
        np.empty(most, np.int64),
        np.empty(most, np.int64),
        np.zeros(candidates),
        np.empty(candidates, np.int64),
        np.zeros(boxes, np.bool_),
    )
    return BoxState(
        views,
        boxes,
        fits,
        fitting,
        np.empty(len(fitting.item), np.int64),
        np.zeros(views * boxes, np.int64),
        _occluded_by(evidence.occluders, views, candidates),
        evidence.occluders,
        evidence.inside.copy().reshape(-1),
        missing_cost,
        np.empty(candidates + 1, np.int64),
        np.zeros(candidates, np.bool_),
        pairs,
    )


@kernel
def _occluded_by(occluders: RaggedArray, views: int, candidates: int) -> RaggedArray:
    """Candidates occluded by each, rising, from the rows of those that occlude each."""
    number = np.zeros(views * candidates, np.int64)
    for view in range(views):
        for k in range(occluders.start[view * candidates], occluders.start[(view + 1) * candidates]):
            number[view * candidates + occluders.item[k]] += 1
    occluded, place = ragged_array(number)
    for view in range(views):
        for i in range(candidates):
            for k in range(occluders.start[view * candidates + i], occluders.start[view * candidates + i + 1]):
                append(occluded, place, view * candidates + occluders.item[k], i, occluders.value[k])
    return occluded


@part
def list_members(i: int, inside: Flags, state: BoxState) -> None:
    """List the members of the boxes of candidate i anew, who has joined or left the set, inside (candidate,)."""
    fits, fitting = state.fits, state.fitting
    for view in range(state.views):
        row = view * len(state.is_linked) + i
        for k in range(fits.start[row], fits.start[row + 1]):
            box = view * state.boxes + fits.item[k]
            first = place = fitting.start[box]
            for m in range(first, fitting.start[box + 1]):
                if inside[fitting.item[m]]:
                    state.fitting_members[place] = fitting.item[m]
                    place += 1
            state.members[box] = place - first


@part
def box_gain(view: int, i: int, inside: Flags, state: BoxState, parameters: ScoreParameters) -> float:
    """Change of a view's box score when candidate i joins the set, inside (candidate,), without i: nats."""
    number = link(view, i, inside, state)
    if number == 1:
        return _score_alone(view * len(state.is_linked) + i, inside, state, parameters)
    before = _score_of_linked(view, 1, number, inside, state, parameters)
    inside[i] = True
    after = _score_of_linked(view, 0, number, inside, state, parameters)
    inside[i] = False
    return after - before


@part
def box_part(view: int, i: int, inside: Flags, state: BoxState, parameters: ScoreParameters) -> float:
    """A view's evidence for candidate i as a further member of the set, inside (candidate,): nats."""
    number = link(view, i, inside, state)
    inside[i] = True
    _score_of_linked(view, 0, number, inside, state, parameters)
    inside[i] = False
    row = view * len(state.is_linked) + i
    return _missing_cost(row, inside, state, parameters) + float(state.pairs.own_gain[i])


@part
def _score_alone(row: int, inside: Flags, state: BoxState, parameters: ScoreParameters) -> float:
    """A view's score of a candidate that no box and no occlusion links to a member, nats."""
    missing, best = _missing_cost(row, inside, state, parameters), 0.0
    for k in range(state.fits.start[row], state.fits.start[row + 1]):
        best = max(best, state.fits.value[k] - missing)
    return float(missing + best)


@part
def link(view: int, i: int, inside: Flags, state: BoxState) -> int:
    """Fill `state.linked` with i and the members with parts of the score that may depend on i; returns their number."""
    linked, is_linked, candidates = state.linked, state.is_linked, len(state.is_linked)
    fits, fitting, occluded = state.fits, state.fitting, state.occluded
    linked[0], number, row = i, 1, view * candidates + i
    for k in range(occluded.start[row], occluded.start[row + 1]):
        j = occluded.item[k]
        if inside[j]:
            linked[number], is_linked[j] = j, True
            number += 1
    done = 0
    while done < number:
        row = view * candidates + linked[done]
        done += 1
        for k in range(fits.start[row], fits.start[row + 1]):
            box = view * state.boxes + fits.item[k]
            for m in range(fitting.start[box], fitting.start[box] + state.members[box]):
                j = state.fitting_members[m]
                if inside[j] and not is_linked[j]:
                    linked[number], is_linked[j] = j, True
                    number += 1
    for k in range(number):
        is_linked[linked[k]] = False
    return number


@part
def _score_of_linked(
    view: int, first: int, number: int, inside: Flags, state: BoxState, parameters: ScoreParameters
) -> float:
    """A view's score of the linked from `first` on, nats: boxes go to them in falling order of their gain."""
    total, count, candidates = 0.0, 0, len(state.is_linked)
    fits, pairs = state.fits, state.pairs
    for a in range(first, number):
        row = view * candidates + state.linked[a]
        missing = _missing_cost(row, inside, state, parameters)
        total += missing
        pairs.own_gain[state.linked[a]], pairs.own_box[state.linked[a]] = 0.0, -1
        for k in range(fits.start[row], fits.start[row + 1]):
            if fits.value[k] > missing:
                pairs.gain[count], pairs.member[count] = fits.value[k] - missing, state.linked[a]
                pairs.box[count] = fits.item[k]
                count += 1
    return total + _assigned_gain(count, pairs)


@part
def _missing_cost(row: int, inside: Flags, state: BoxState, parameters: ScoreParameters) -> float:
    """Cost of a missing box of a candidate that members may hide in part, nats."""
    visible, is_occluded = state.visible[row], False
    for k in range(state.occluders.start[row], state.occluders.start[row + 1]):
        if inside[state.occluders.item[k]]:
            visible *= state.occluders.value[k]
            is_occluded = True
    return missing_box_cost(visible, parameters) if is_occluded else float(state.missing_cost[row])


@part
def _assigned_gain(count: int, pairs: BoxPairs) -> float:
    """Gain of the first pairs, assigned one to one in falling order of their gains, nats."""
    total = 0.0
    while True:
        best, gain = -1, 0.0
        for k in range(count):
            if pairs.gain[k] > gain and pairs.own_gain[pairs.member[k]] == 0 and not pairs.has_member[pairs.box[k]]:
                best, gain = k, pairs.gain[k]
        if best < 0:
            break
        pairs.own_gain[pairs.member[best]], pairs.own_box[pairs.member[best]] = gain, pairs.box[best]
        pairs.has_member[pairs.box[best]] = True
        total += gain
    for k in range(count):
        pairs.has_member[pairs.box[k]] = False
    return total
