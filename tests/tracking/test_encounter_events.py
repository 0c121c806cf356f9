"""Who met whom: one encounter a meeting, however windows cut the recording."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from stseg.arrays import Rows
from stseg.records.blobs import Blobs
from stseg.trackers.rows import event_rows
from stseg.tracking.windows.encounters import encounters, touches

LENGTH, RATE = 30, 5.0


def frame_of(pairs: set[tuple[int, int]]) -> Blobs:
    """Four blobs, of which these touch."""
    none = np.zeros((0, 2))
    names, amounts = np.zeros(4, np.int64), np.zeros(4)
    touching = np.array(sorted(pairs), np.int64).reshape(-1, 2)
    cells = np.zeros((1, 1), np.int32)
    return Blobs(cells, names, names, none, none, amounts, amounts, amounts, touching)


def told(touching: list[set[tuple[int, int]]], names: list[int], cuts: list[int]) -> Rows:
    """What windows that are cut there tell; the blobs' names stay."""
    rows = []
    for first, stop in pairwise(sorted({0, *cuts, LENGTH})):
        blobs = [frame_of(pairs) for pairs in touching[first:stop]]
        rows += touches(first, blobs, [np.array(names)] * len(blobs))
    return event_rows(sorted(rows))


def same(track: int, _: int) -> int:
    return track


def plain(touching: list[set[tuple[int, int]]], names: list[int], parting: int) -> list[tuple[int, bytes, int, int]]:
    """The definition, frame by frame."""
    found = []
    for a, b in {tuple(sorted((names[i], names[j]))) for pairs in touching for i, j in pairs}:
        frames = [
            f for f, pairs in enumerate(touching) if (a, b) in {tuple(sorted((names[i], names[j]))) for i, j in pairs}
        ]
        for k, frame in enumerate(frames):
            if a > 0 and (k == 0 or frame - frames[k - 1] - 1 > parting):
                found.append((frame, b"merge", a, b))
            if a > 0 and frame < LENGTH - 1 and (k + 1 == len(frames) or frames[k + 1] - frame - 1 > parting):
                found.append((frame + 1, b"split", a, b))
    return sorted(found)


PAIRS = st.sets(st.sampled_from([(0, 1), (0, 2), (1, 3), (2, 3)]), max_size=3)


@settings(max_examples=80, deadline=None)
@given(
    st.lists(PAIRS, min_size=LENGTH, max_size=LENGTH), st.permutations([0, 1, 2, 7]),
    st.lists(st.integers(1, LENGTH - 1), max_size=5), st.integers(0, 6),
)  # fmt: skip
def test_encounters_do_not_depend_on_the_windows(
    touching: list[set[tuple[int, int]]], names: list[int], cuts: list[int], parting: int
) -> None:
    found = encounters(told(touching, names, cuts), same, parting, RATE, LENGTH - 1)
    assert found[["frame", "kind", "id", "other"]].tolist() == plain(touching, names, parting)


def test_an_encounter_says_how_long_it_was() -> None:
    touching = [{(0, 1)} if 3 <= f < 13 and f != 8 else set() for f in range(LENGTH)]
    merge, split = encounters(told(touching, [1, 2, 3, 4], [6]), same, 2, RATE, LENGTH - 1)
    assert (merge["frame"], merge["reason"]) == (3, b"their cells touch, for 2.0 s")
    assert split["frame"] == 13


def test_encounters_are_under_new_names_and_never_with_oneself() -> None:
    touching = [{(0, 1), (2, 3)} if f < 10 else set() for f in range(LENGTH)]
    rows = told(touching, [1, 2, 3, 4], [5])

    def name(track: int, frame: int) -> int:
        return {1: 9 if frame < 5 else 6, 2: 2, 3: 8, 4: 8}[track]

    found = encounters(rows, name, 2, RATE, LENGTH - 1)
    assert [(f, i, o) for f, kind, i, o, _ in found.tolist() if kind == b"merge"] == [(0, 2, 9), (5, 2, 6)]
    assert not len(encounters(rows, lambda _, __: 0, 2, RATE, LENGTH - 1))
