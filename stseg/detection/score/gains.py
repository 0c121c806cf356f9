"""Gains of candidates: the change of the score with one more member, or without one (`scoring`).

Gains are kept, view by view, until a member comes or goes that they depend on.
"""

from stseg.arrays import Floats, Ints
from stseg.detection.score.box_state import box_gain, box_part
from stseg.detection.score.pixel_state import assign_in_view, overlaps, pixel_gain, reassign_pixels
from stseg.detection.score.set_state import SetState
from stseg.detection.score.track_state import assign_track, release_track, track_after, track_gain
from stseg.kernels.accelerate import kernel


@kernel
def gain(i: int, absent: int, state: SetState) -> float:
    """Gain of candidate i as a further member, or what member i is worth, nats; it is kept until a move changes it.

    With a member who is `absent` for the while (`withdraw`, then `put` without a move), what depends on that member is
    computed and not kept; -1 where all are there.
    """
    problem, boxes, pixels, is_member = state.problem, state.boxes, state.pixels, state.inside[i]
    candidates, views = len(state.inside), len(pixels.evidence.raster)
    whole = (boxes.views + views) * candidates + i
    if absent < 0 and state.is_known[whole]:
        return float(state.gains[whole])
    state.remaining[0] -= 1
    total = problem.parameters.prior_log_odds + problem.size_prior[i] - problem.birth_cost[i]
    neighbours = problem.neighbours
    for k in range(neighbours.start[i], neighbours.start[i + 1]):
        total -= neighbours.value[k] if state.inside[neighbours.item[k]] else 0.0
    pixel_sum = 0.0
    for view in range(views):
        row = view * candidates + i
        known = boxes.views * candidates + row
        is_kept = absent < 0 or not overlaps(row, absent, pixels.evidence.overlapping)
        if is_kept and state.is_known[known]:
            pixel_sum += state.gains[known]
            continue
        if is_member:
            reassign_pixels(view, i, state.inside, pixels)
        gained = pixel_gain(view, i, pixels)
        if is_member:
            assign_in_view(view, i, pixels)
        if is_kept:
            state.gains[known], state.is_known[known] = gained, True
        pixel_sum += gained
    total += problem.parameters.effective_observations * pixel_sum
    state.inside[i] = False
    if is_member:
        release_track(i, state.inside, state.tracks)
    total += track_gain(i, state.tracks)
    if is_member:
        assign_track(i, state.tracks)
    for view in range(boxes.views):
        row = view * candidates + i
        if absent < 0 and state.is_known[row]:
            total += state.gains[row]
            continue
        gained = box_gain(view, i, state.inside, boxes, problem.parameters)
        if absent < 0:
            state.gains[row], state.is_known[row] = gained, True
        total += gained
    state.inside[i] = is_member
    if absent < 0:
        state.gains[whole], state.is_known[whole] = total, True
    return float(total)


@kernel
def fill_evidence(i: int, state: SetState, parts: Floats, box: Ints) -> int:
    """Fill parts and box (view,) of candidate i as a further member: evidence, nats, and its box, -1 for none.

    Views with boxes come first; box is filled for these alone. Evidence of pixels is that of the gain that was asked
    for last. Returns the predicted track that it continues, -1 for a birth.
    """
    boxes, parameters = state.boxes, state.problem.parameters
    for view in range(boxes.views):
        parts[view] = box_part(view, i, state.inside, boxes, parameters)
        box[view] = boxes.pairs.own_box[i]
    for view in range(len(state.pixels.evidence.raster)):
        parts[boxes.views + view] = parameters.effective_observations * state.pixels.view_evidence[view, i]
    return track_after(i, state.tracks)
