"""How many processes a run has by itself."""

from __future__ import annotations

import os

import pytest

from stseg.engine.workers import worker_processes
from stseg.engine.workers.worker_processes import processes_that_fit


@pytest.fixture(autouse=True)
def machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """16 cores, 8 GiB of free memory."""
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(16)), raising=False)
    monkeypatch.setattr(worker_processes, "free_memory", lambda: 8 * 2**30)


@pytest.mark.parametrize(
    ("ground_side", "views", "processes"), [(6, 4, 11), (20, 7, 5), (40, 8, 1), (400, 8, 1)]
)  # one of 20 m and 7 views was measured at 0.9 GiB, one of 40 m and 7 views at 3.8 GiB
def test_a_large_ground_leaves_room_for_fewer(ground_side: int, views: int, processes: int) -> None:
    assert processes_that_fit(views * 10 * (10 * ground_side) ** 2) == processes
