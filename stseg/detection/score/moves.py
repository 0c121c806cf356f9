"""Moves of a set's state: a member comes or goes, evidence is assigned anew, and gains that depend on it are forgotten.

The work of a move is that of its neighbourhood.
"""

from stseg.arrays import Flags, Floats, Ints
from stseg.detection.problem import DetectionProblem, RaggedArray
from stseg.detection.score.box_state import link, list_members
from stseg.detection.score.gains import fill_evidence, gain
from stseg.detection.score.pixel_state import assign_pixels, reassign_pixels, release_pixels
from stseg.detection.score.set_state import NO_MEMBER, Kept, SetState, set_state
from stseg.detection.score.track_state import assign_track, linked_tracks, release_track
from stseg.kernels.accelerate import kernel, part
from stseg.kernels.pointed_tuples import pointed


@kernel
def add(i: int, place: int, state: SetState) -> None:
    """Add candidate i to the set at a place, from where the member goes to the last one."""
    state.total[0] += gain(i, NO_MEMBER, state)
    _forget(i, state)
    put(i, place, state)


@kernel
def remove(place: int, state: SetState) -> None:
    """Remove the member at a place from the set; the last member moves there."""
    state.total[0] -= gain(state.members[place], NO_MEMBER, state)
    _forget(withdraw(place, state), state)


@kernel
def put(i: int, place: int, state: SetState) -> None:
    """Put candidate i at a place of the set, and back again after it was withdrawn from it; gains are kept."""
    members, size = state.members, state.size
    members[size[0]] = members[place]
    members[place] = i
    size[0] += 1
    assign_pixels(i, state.pixels)
    _assign_others(i, state)


@part
def _assign_others(i: int, state: SetState) -> None:
    """Assign to candidate i, as a member, what is no pixel: boxes and a track."""
    state.inside[i] = True
    assign_track(i, state.tracks)
    list_members(i, state.inside, state.boxes)


@part
def _release_others(i: int, state: SetState) -> None:
    """Take these from candidate i, which is no member then."""
    state.inside[i] = False
    release_track(i, state.inside, state.tracks)
    list_members(i, state.inside, state.boxes)


@kernel
def withdraw(place: int, state: SetState) -> int:
    """Take the member at a place out of the set, and keep the gains; returns the candidate."""
    members, size, i = state.members, state.size, int(state.members[place])
    size[0] -= 1
    members[place] = members[size[0]]
    for view in range(len(state.pixels.evidence.raster)):
        reassign_pixels(view, i, state.inside, state.pixels)
    _release_others(i, state)
    return i


@kernel
def _forget(i: int, state: SetState) -> None:
    """Forget the gains that depend on whether candidate i, outside now, is in the set."""
    candidates, boxes, pixels, tracks = len(state.inside), state.boxes, state.pixels.evidence, state.tracks
    state.moves[0] += 1
    whole = boxes.views + len(pixels.raster)
    _forget_part(whole, i, state)
    neighbours = state.problem.neighbours
    for k in range(neighbours.start[i], neighbours.start[i + 1]):
        if neighbours.value[k] > 0:
            _forget_part(whole, neighbours.item[k], state)
    for row in range(i, len(pixels.overlapping.start) - 1, candidates):
        _forget_row(boxes.views + row // candidates, row, pixels.overlapping, state)
    for r in range(linked_tracks(i, state.inside, tracks)):
        _forget_row(whole, tracks.reached[r], tracks.followers, state)
    for view in range(boxes.views):
        _forget_row(view, view * candidates + i, boxes.occluded, state)
        for a in range(link(view, i, state.inside, boxes)):
            row = view * candidates + boxes.linked[a]
            _forget_row(view, row, boxes.occluders, state)
            for k in range(boxes.fits.start[row], boxes.fits.start[row + 1]):
                _forget_row(view, view * boxes.boxes + boxes.fits.item[k], boxes.fitting, state)


@part
def _forget_row(number: int, row: int, rows: RaggedArray, state: SetState) -> None:
    """Forget a part of the gains of all candidates of a row."""
    for k in range(rows.start[row], rows.start[row + 1]):
        _forget_part(number, rows.item[k], state)


@part
def _forget_part(number: int, i: int, state: SetState) -> None:
    """Forget a part of a candidate's gain, and the whole."""
    candidates = len(state.inside)
    state.is_known[number * candidates + i] = state.is_known[len(state.is_known) - candidates + i] = False
    state.changed[i] = state.moves[0]


@kernel
def copy_of(state: SetState) -> Kept:
    """All that is known of a set now."""
    return Kept(state.kept.numbers.copy(), state.kept.values.copy(), state.kept.flags.copy())


@kernel
def return_to(before: Kept, state: SetState) -> None:
    """Take back the moves since a copy was made, without forgetting the gains of then."""
    for a in range(state.size[0] - 1, -1, -1):
        if not before.flags[state.members[a]]:
            withdraw(a, state)
    for i in range(len(state.inside)):
        if before.flags[i] and not state.inside[i]:
            put(i, state.size[0], state)
    for k in range(len(before.numbers)):  # in loops, since slices that are assigned to are slow to compile
        state.kept.numbers[k] = before.numbers[k]
    for k in range(len(before.values)):
        state.kept.values[k] = before.values[k]
    for k in range(len(before.flags)):
        state.kept.flags[k] = before.flags[k]


@kernel
def release(state: SetState) -> None:
    """Assign no pixel again."""
    for a in range(state.size[0]):
        release_pixels(state.members[a], state.pixels)


@kernel
def score_of(members: Ints, problem: DetectionProblem) -> float:
    """Score of the members, int64 (n,), of a problem: nats."""
    whole = set_state(problem)
    state = pointed(whole)
    for i in members:
        add(i, state.size[0], state)
    release(state)
    return float(whole.total[0])


@kernel
def fill_gains(
    members: Ints,
    candidates: Ints,
    problem: DetectionProblem,
    gains: Floats,
    view_evidence: Floats,
    boxes: Ints,
    tracks: Ints,
) -> None:
    """Fill gains (k,) with those of some candidates, int64 (k,), in the set of the members, int64 (n,): nats.

    Filled with what `fill_evidence` says of each, of members beside the others, are `view_evidence` float64 (view, k),
    boxes int64 (view, k) and tracks int64 (k,). If gains are (0,), boxes and tracks alone are found.
    """
    whole = set_state(problem)
    state = pointed(whole)
    for i in members:
        if len(gains):
            put(i, state.size[0], state)
        else:
            _assign_others(i, state)
    for k in range(len(candidates)):
        i, place, is_member = candidates[k], 0, state.inside[candidates[k]]
        if len(gains):
            while is_member and state.members[place] != i:
                place += 1
            if is_member:
                withdraw(place, state)
            gains[k] = gain(i, NO_MEMBER, state)
        elif is_member:
            _release_others(i, state)
        tracks[k] = fill_evidence(i, state, view_evidence[:, k], boxes[:, k])
        if is_member and len(gains):
            put(i, place, state)
        elif is_member:
            _assign_others(i, state)
    release(state)
    whole.size[0] = 0  # held by name until here (`pointed`)


@kernel
def fill_rises(members: Ints, leaving: Flags, joining: Ints, problem: DetectionProblem, rises: Floats) -> None:
    """Fill rises float64 (k,): by how much one exchange each raises the score of the members, int64 (n,), nats.

    In exchange k the members leave that `leaving` bool (k, candidate) marks, and candidate `joining[k]` joins, int64
    (k,).
    """
    whole = set_state(problem)
    state = pointed(whole)
    for i in members:
        put(i, state.size[0], state)
    for k in range(len(joining)):
        before = copy_of(state)
        for a in range(state.size[0] - 1, -1, -1):
            if leaving[k, state.members[a]]:
                remove(a, state)
        add(joining[k], state.size[0], state)
        rises[k] = state.total[0] - before.values[0]
        return_to(before, state)
    release(state)
    whole.size[0] = 0  # held by name until here (`pointed`)
