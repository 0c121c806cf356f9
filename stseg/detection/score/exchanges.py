"""Exchanges of a set: one candidate for some members, as merge moves try them."""

from stseg.arrays import Flags, Floats, Ints
from stseg.detection.problem import DetectionProblem
from stseg.detection.score.moves import add, copy_of, put, release, remove, return_to
from stseg.detection.score.set_state import set_state
from stseg.kernels.accelerate import kernel
from stseg.kernels.pointed_tuples import pointed


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
