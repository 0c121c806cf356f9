"""Who shares boxes with whom, as lists: the gain of one more person in the views with boxes, among those alone.

One more person changes what a view says of the members behind, of those who fit the same boxes, of those who fit the
boxes of these, and so on. They are few, so the boxes of a view are assigned anew among them alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stseg.accelerate import kernel, part
from stseg.arrays import Flags, Floats, Ints
from stseg.detection.lists import Lists, append, lists_of
from stseg.detection.problem import BoxEvidence, Parameters
from stseg.detection.scoring import missing_by_share


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
        Candidates of whom one hides a part.
    hiders
        Candidates who hide a part of one, with the share that they leave.
    visible : float64 (view * candidate,)
        Share of the candidate's pillar inside the image.
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
    linked: Ints
    reached: Flags
    pairs: Pairs


@kernel
def box_sharing(evidence: BoxEvidence, parameters: Parameters) -> BoxSharing:
    """The lists of all candidates."""
    views, candidates, boxes = evidence.match.shape
    threshold = np.log(parameters.box_miss_rate) - parameters.box_log_ratio
    fit, fitted = np.zeros(views * candidates, np.int64), np.zeros(views * boxes, np.int64)
    hide, hidden_by = np.zeros(views * candidates, np.int64), np.zeros(views * candidates, np.int64)
    for view in range(views):
        for i in range(candidates):
            row = view * candidates + i
            for b in range(evidence.boxes[view]):
                if evidence.match[view, i, b] > threshold:
                    fit[row] += 1
                    fitted[view * boxes + b] += 1
            for j in range(candidates):
                if evidence.cover[view, i, j] > 0.0:
                    hidden_by[row] += 1
                    hide[view * candidates + j] += 1
    (fits, fit), (fitting, fitted) = lists_of(fit), lists_of(fitted)
    (hidden, hide), (hiders, hidden_by) = lists_of(hide), lists_of(hidden_by)
    for view in range(views):
        for i in range(candidates):
            row = view * candidates + i
            for b in range(evidence.boxes[view]):
                if evidence.match[view, i, b] > threshold:
                    gain = parameters.box_log_ratio + evidence.match[view, i, b]
                    append(fits, fit, row, b, gain)
                    append(fitting, fitted, view * boxes + b, i, gain)
            for j in range(candidates):
                if evidence.cover[view, i, j] > 0.0:
                    append(hidden, hide, view * candidates + j, i, 1.0 - evidence.cover[view, i, j])
                    append(hiders, hidden_by, row, j, 1.0 - evidence.cover[view, i, j])
    most = len(fits.item) + 1
    pairs = Pairs(
        np.empty(most), np.empty(most, np.int64), np.empty(most, np.int64),
        np.zeros(candidates, np.bool_), np.zeros(boxes, np.bool_),
    )  # fmt: skip
    return BoxSharing(
        views, boxes, fits, fitting, hidden, hiders, evidence.inside.copy().reshape(-1),
        np.empty(candidates + 1, np.int64), np.zeros(candidates, np.bool_), pairs,
    )  # fmt: skip


@part
def box_gain(i: int, inside: Flags, sharing: BoxSharing, parameters: Parameters) -> float:
    """What all views with boxes say of candidate i beside a set, inside (candidate,), that i is not of: nats."""
    total = 0.0
    for view in range(sharing.views):
        number = _link(view, i, inside, sharing)
        total -= _score_of_linked(view, 1, number, inside, sharing, parameters)
        inside[i] = True
        total += _score_of_linked(view, 0, number, inside, sharing, parameters)
        inside[i] = False
    return total


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
        missing = missing_by_share(_visible(row, inside, sharing), parameters)
        total += missing
        for k in range(fits.start[row], fits.start[row + 1]):
            if fits.value[k] > missing:
                pairs.gain[found], pairs.person[found] = fits.value[k] - missing, sharing.linked[a]
                pairs.box[found] = fits.item[k]
                found += 1
    return total + _assigned_gain(found, pairs)


@part
def _visible(row: int, inside: Flags, sharing: BoxSharing) -> float:
    """Share of a candidate's pillar in the image and not behind a member's, 0..1."""
    visible = sharing.visible[row]
    for k in range(sharing.hiders.start[row], sharing.hiders.start[row + 1]):
        if inside[sharing.hiders.item[k]]:
            visible *= sharing.hiders.value[k]
    return float(visible)


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
