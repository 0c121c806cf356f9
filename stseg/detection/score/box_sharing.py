"""Who shares boxes with whom, as lists: the gain of one more person in the views with boxes, among those alone.

One more person changes what a view says of the members behind, of those who fit the same boxes, of those who fit the
boxes of these, and so on. They are few, so the boxes of a view are assigned anew among them alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.detection.evidence.ragged_lists import Lists, append, lists_of
from stseg.detection.problem import BoxEvidence, Parameters
from stseg.detection.score.scoring import missing_by_share
from stseg.kernels.accelerate import kernel, part


class Pairs(NamedTuple):
    """Scratch for the assignment of boxes: pairs of a person and a box, and who and what is taken."""

    gain: Floats
    person: Ints
    box: Ints
    served: Flags
    taken: Flags


class BoxSharing(NamedTuple):
    """Lists of the candidates of a problem; the row of a candidate in a view is view * candidates + candidate.

    Attributes
    ----------
    views
        Number of views with boxes.
    boxes
        Most boxes of a view: the row of a box is view * boxes + box.
    fits
        Boxes that a candidate may gain by, with that gain beside no box at no cost, nats.
    fitting
        The candidates of each box.
    hidden
        Candidates of whom one hides a part, with the share that is left.
    hiders
        Candidates who hide a part of one, with the share that they leave.
    visible, missing : float64 (view * candidate,)
        Share of the candidate's pillar inside the image, and the cost of a missing box where nobody hides it, nats.
    is_known : bool (view * candidate,), before, after : float64 (view * candidate,)
        Whether it is known what the view says beside the set, less the candidate, of those whom the candidate is linked
        to, without and with the candidate, nats.
    linked : int64 (candidate + 1,), reached : bool (candidate,), pairs
        Scratch; nobody is reached before and after.
    """

    views: int
    boxes: int
    fits: Lists
    fitting: Lists
    hidden: Lists
    hiders: Lists
    visible: Floats
    missing: Floats
    is_known: Flags
    before: Floats
    after: Floats
    linked: Ints
    reached: Flags
    pairs: Pairs


@kernel
def box_sharing(evidence: BoxEvidence, parameters: Parameters) -> BoxSharing:
    """The lists of all candidates."""
    views, candidates, boxes = evidence.match.shape
    threshold = np.log(parameters.box_miss_rate) - parameters.box_log_ratio
    fit, fitted = np.zeros(views * candidates, np.int64), np.zeros(views * boxes, np.int64)
    missing = np.empty(views * candidates)
    for view in range(views):
        for i in range(candidates):
            row = view * candidates + i
            missing[row] = missing_by_share(evidence.inside[view, i], parameters)
            for b in range(evidence.boxes[view]):
                if evidence.match[view, i, b] > threshold:
                    fit[row] += 1
                    fitted[view * boxes + b] += 1
    (fits, fit), (fitting, fitted) = lists_of(fit), lists_of(fitted)
    for view in range(views):
        for i in range(candidates):
            row = view * candidates + i
            for b in range(evidence.boxes[view]):
                if evidence.match[view, i, b] > threshold:
                    gain = parameters.box_log_ratio + evidence.match[view, i, b]
                    append(fits, fit, row, b, gain)
                    append(fitting, fitted, view * boxes + b, i, gain)
    most = len(fits.item) + 1
    pairs = Pairs(
        np.empty(most), np.empty(most, np.int64), np.empty(most, np.int64),
        np.zeros(candidates, np.bool_), np.zeros(boxes, np.bool_),
    )  # fmt: skip
    return BoxSharing(
        views, boxes, fits, fitting, _hidden_by(evidence.hiders, views, candidates), evidence.hiders,
        evidence.inside.copy().reshape(-1), missing, np.zeros(views * candidates, np.bool_),
        np.empty(views * candidates), np.empty(views * candidates), np.empty(candidates + 1, np.int64),
        np.zeros(candidates, np.bool_), pairs,
    )  # fmt: skip


@kernel
def _hidden_by(hiders: Lists, views: int, candidates: int) -> Lists:
    """Whom each candidate hides, rising, from the lists of those who hide each."""
    number = np.zeros(views * candidates, np.int64)
    for view in range(views):
        for k in range(hiders.start[view * candidates], hiders.start[(view + 1) * candidates]):
            number[view * candidates + hiders.item[k]] += 1
    hidden, place = lists_of(number)
    for view in range(views):
        for i in range(candidates):
            for k in range(hiders.start[view * candidates + i], hiders.start[view * candidates + i + 1]):
                append(hidden, place, view * candidates + hiders.item[k], i, hiders.value[k])
    return hidden


@part
def box_gain(i: int, inside: Flags, sharing: BoxSharing, parameters: Parameters) -> float:
    """What all views with boxes say of candidate i beside a set, inside (candidate,), that i is not of: nats."""
    total = 0.0
    for view in range(sharing.views):
        before, after = _linked_scores(view, i, inside, sharing, parameters)
        total -= before
        total += after
    return total


@part
def known_box_gain(i: int, inside: Flags, sharing: BoxSharing, parameters: Parameters) -> float:
    """The same of the set, inside (candidate,), less i, by what is known of it."""
    total, candidates = 0.0, len(sharing.reached)
    for view in range(sharing.views):
        row = view * candidates + i
        if not sharing.is_known[row]:
            sharing.before[row], sharing.after[row] = _linked_scores(view, i, inside, sharing, parameters)
            sharing.is_known[row] = True
        total -= sharing.before[row]
        total += sharing.after[row]
    return total


@part
def forget(sharing: BoxSharing) -> None:
    """Know nothing of a set."""
    for row in range(len(sharing.is_known)):
        sharing.is_known[row] = False


@part
def forget_linked(i: int, inside: Flags, sharing: BoxSharing) -> None:
    """Forget what depends on whether candidate i is in the set, inside (candidate,), that i is not of.

    That is what views say of all who fit the boxes, or hide a part, of i and of the members that i is linked to, and of
    those whom i hides.
    """
    candidates, fits, fitting, hiders = len(sharing.reached), sharing.fits, sharing.fitting, sharing.hiders
    for view in range(sharing.views):
        first = view * candidates
        for k in range(sharing.hidden.start[first + i], sharing.hidden.start[first + i + 1]):
            sharing.is_known[first + sharing.hidden.item[k]] = False
        for a in range(_link(view, i, inside, sharing)):
            row = first + sharing.linked[a]
            for k in range(hiders.start[row], hiders.start[row + 1]):
                sharing.is_known[first + hiders.item[k]] = False
            for k in range(fits.start[row], fits.start[row + 1]):
                box = view * sharing.boxes + fits.item[k]
                for m in range(fitting.start[box], fitting.start[box + 1]):
                    sharing.is_known[first + fitting.item[m]] = False


@part
def _linked_scores(
    view: int, i: int, inside: Flags, sharing: BoxSharing, parameters: Parameters
) -> tuple[float, float]:
    """What a view says of those whom candidate i is linked to, without and with i, nats."""
    number = _link(view, i, inside, sharing)
    if number == 1:
        return 0.0, _score_alone(view * len(sharing.reached) + i, inside, sharing, parameters)
    before = _score_of_linked(view, 1, number, inside, sharing, parameters)
    inside[i] = True
    after = _score_of_linked(view, 0, number, inside, sharing, parameters)
    inside[i] = False
    return before, after


@part
def _score_alone(row: int, inside: Flags, sharing: BoxSharing, parameters: Parameters) -> float:
    """What a view says of a candidate whom no box and no occlusion links to a member, nats."""
    missing, best = _missing(row, inside, sharing, parameters), 0.0
    for k in range(sharing.fits.start[row], sharing.fits.start[row + 1]):
        best = max(best, sharing.fits.value[k] - missing)
    return float(missing + best)


@part
def _link(view: int, i: int, inside: Flags, sharing: BoxSharing) -> int:
    """Fill `sharing.linked` with i and the members whose part of the score may depend on i; returns their number."""
    linked, reached, candidates = sharing.linked, sharing.reached, len(sharing.reached)
    fits, fitting, hidden = sharing.fits, sharing.fitting, sharing.hidden
    linked[0], number, row = i, 1, view * candidates + i
    for k in range(hidden.start[row], hidden.start[row + 1]):
        j = hidden.item[k]
        if inside[j]:
            linked[number], reached[j] = j, True
            number += 1
    done = 0
    while done < number:
        row = view * candidates + linked[done]
        done += 1
        for k in range(fits.start[row], fits.start[row + 1]):
            box = view * sharing.boxes + fits.item[k]
            for m in range(fitting.start[box], fitting.start[box + 1]):
                j = fitting.item[m]
                if inside[j] and not reached[j]:
                    linked[number], reached[j] = j, True
                    number += 1
    for k in range(number):
        reached[linked[k]] = False
    return number


@part
def _score_of_linked(
    view: int, first: int, number: int, inside: Flags, sharing: BoxSharing, parameters: Parameters
) -> float:
    """What a view says of the linked from `first` on, nats: boxes go to them in falling order of their gain."""
    total, found, candidates = 0.0, 0, len(sharing.reached)
    fits, pairs = sharing.fits, sharing.pairs
    for a in range(first, number):
        row = view * candidates + sharing.linked[a]
        missing = _missing(row, inside, sharing, parameters)
        total += missing
        for k in range(fits.start[row], fits.start[row + 1]):
            if fits.value[k] > missing:
                pairs.gain[found], pairs.person[found] = fits.value[k] - missing, sharing.linked[a]
                pairs.box[found] = fits.item[k]
                found += 1
    return total + _assigned_gain(found, pairs)


@part
def _missing(row: int, inside: Flags, sharing: BoxSharing, parameters: Parameters) -> float:
    """Cost of a missing box of a candidate, of whom members may hide a part, nats."""
    visible, is_hidden = sharing.visible[row], False
    for k in range(sharing.hiders.start[row], sharing.hiders.start[row + 1]):
        if inside[sharing.hiders.item[k]]:
            visible *= sharing.hiders.value[k]
            is_hidden = True
    return missing_by_share(visible, parameters) if is_hidden else float(sharing.missing[row])


@part
def _assigned_gain(found: int, pairs: Pairs) -> float:
    """Gain of the first pairs, assigned one to one in falling order of their gains, nats."""
    total = 0.0
    while True:
        best, gain = -1, 0.0
        for k in range(found):
            if pairs.gain[k] > gain and not pairs.served[pairs.person[k]] and not pairs.taken[pairs.box[k]]:
                best, gain = k, pairs.gain[k]
        if best < 0:
            break
        pairs.served[pairs.person[best]] = pairs.taken[pairs.box[best]] = True
        total += gain
    for k in range(found):
        pairs.served[pairs.person[k]] = pairs.taken[pairs.box[k]] = False
    return total
