"""Segments of a recording: how it is divided, and how what they find is joined."""

import numpy as np
import pytest
from checks import drawn
from hypothesis import strategies as st
from run_files import trajectory_of

from stseg.arrays import Rows
from stseg.config import Config, SegmentConfig, TrackingConfig
from stseg.engine.offline.segments import segments
from stseg.records.tables import TRAJECTORY
from stseg.trackers.rows import event_rows
from stseg.tracking.segment_stitching import SegmentTracks, Stitcher, renamed_labels
from stseg.tracking.windows.windows import windows


def standing(track: int, frames: range, x: float) -> Rows:
    return trajectory_of(*((frame, track, x, 1.0) for frame in frames))


def events(*rows: tuple[int, str, int, int]) -> Rows:
    return event_rows([(*row, "reason") for row in rows])


def stitched(*segments: tuple[Rows, Rows]) -> tuple[Rows, Rows]:
    """Rows and events of segments of twenty frames, under names of the run."""
    stitcher = Stitcher()
    found = [stitcher.add(SegmentTracks(20 * k, rows, told)) for k, (rows, told) in enumerate(segments)]
    for one, (rows, _), first in zip(found, segments, range(0, 99, 20), strict=False):
        assert one.committed["id"].tolist() == one.names[rows["id"][rows["frame"] >= first]].tolist()
    return np.concatenate([one.committed for one in found]), np.concatenate([one.events for one in found])


@drawn(60, st.floats(1.0, 30.0), st.integers(0, 500), st.integers(1, 3000), st.floats(1.0, 60.0), st.integers(0, 10)
)  # fmt: skip
def test_segments_partition_the_run(rate: float, first: int, length: int, seconds: float, warm_up: int) -> None:
    config = Config(segments=SegmentConfig(length=seconds, warm_up=warm_up))
    parts = segments(rate, config, first, first + length)
    assert [part.index for part in parts] == list(range(len(parts)))
    assert [part.first for part in parts] == [first, *(part.stop for part in parts[:-1])]
    assert parts[-1].stop == first + length and parts[0].lead == first
    for part in parts:
        assert first <= part.lead <= part.first < part.stop
        assert part.first - part.lead >= min(part.first - first, warm_up * rate) or part.index == 0


def test_less_than_two_segments_become_two_of_equal_work() -> None:
    config = Config(segments=SegmentConfig(length=120.0, warm_up=6.0))
    for seconds, number in ((70, 1), (80, 2), (239, 2), (250, 3)):
        parts = segments(10.0, config, 100, 100 + 10 * seconds)
        assert len(parts) == number
        if number == 2:
            assert abs((parts[0].stop - parts[0].lead) - (parts[1].stop - parts[1].lead)) <= 2 * 10


@drawn(40, st.floats(1.0, 30.0), st.integers(0, 200), st.integers(100, 1500))
def test_windows_end_where_segments_do(rate: float, first: int, length: int) -> None:
    config = Config(segments=SegmentConfig(length=10.0, warm_up=2.0))
    for part in segments(rate, config, first, first + length):
        commits = list(windows(rate, TrackingConfig(), part.lead, first + length))
        ends = {window.commit_stop for window in commits}
        assert part.stop in ends
        assert part.first == part.lead or part.first in ends


def test_tracks_keep_names_over_seams_and_of_the_longest() -> None:
    first = np.concatenate([standing(1, range(20), 0.0), standing(2, range(20), 4.0)])
    later = np.concatenate([standing(1, range(15, 40), 4.1), standing(2, range(15, 40), 0.1)])
    rows, told = stitched((first, events((0, "birth", 1, 0))), (later, events((25, "merge", 1, 2))))
    assert rows["frame"].tolist() == [*range(20), *range(20), *range(20, 40), *range(20, 40)]
    assert rows["id"].tolist() == [1] * 20 + [2] * 20 + [2] * 20 + [1] * 20
    assert told[["frame", "kind", "id", "other"]].tolist() == [(0, b"birth", 1, 0), (25, b"merge", 2, 1)]
    later = np.concatenate([standing(1, range(15, 40), 0.0), standing(2, range(15, 19), 5.0)])
    rows, told = stitched((standing(1, range(20), 0.0), events()), (later, events()))
    assert np.unique(rows["id"]).tolist() == [1] and len(told) == 0
    both = np.concatenate([standing(1, range(17, 40), 0.2), standing(2, range(10, 40), -0.2)])
    rows, _ = stitched((standing(1, range(20), 0.0), events()), (both, events()))
    assert rows["id"][-1] == 1


@pytest.mark.parametrize(("stop", "begin", "is_told"), [(20, 18, False), (19, 21, True)])
def test_seams_of_unclaimed_tracks(stop: int, begin: int, is_told: bool) -> None:
    """What a segment says itself is not told again."""
    died, born = (events(*[own] * is_told) for own in ((stop - 1, "death", 1, 0), (begin, "birth", 1, 0)))
    rows, found = stitched((standing(1, range(stop), 0.0), died), (standing(1, range(begin, 40), 3.0), born))
    assert found[["frame", "kind", "id"]].tolist() == [(stop - 1, b"death", 1), (max(begin, stop), b"birth", 2)]
    assert np.unique(rows["id"]).tolist() == [1, 2]


@drawn(
    40,
    st.lists(st.integers(0, 6), min_size=12, max_size=12),
    st.lists(st.tuples(st.integers(0, 3), st.integers(1, 6)), unique=True, max_size=12),
    st.integers(0, 9),
)
def test_renaming_maps_every_cell_once(ids: list[int], keys: list[tuple[int, int]], shift: int) -> None:
    label = np.array(ids, np.int32).reshape(4, 1, 1, 3)
    frames = np.array([3, 4, 7, 9])
    rows = np.zeros(len(keys), TRAJECTORY)
    rows["frame"], rows["id"] = [frames[k] for k, _ in keys], [track for _, track in keys]
    identity = (rows["id"] * 3 + shift) % 7
    name_of = dict(zip(zip(rows["frame"].tolist(), rows["id"].tolist(), strict=True), identity.tolist(), strict=True))
    plain = label.copy()
    for cell in np.ndindex(label.shape):
        plain[cell] = name_of.get((int(frames[cell[0]]), int(label[cell])), 0)
    for frame, cells, expected in zip(frames, label, plain, strict=True):
        here = rows["frame"] == frame
        np.testing.assert_array_equal(renamed_labels(cells, rows["id"][here], identity[here]), expected)
