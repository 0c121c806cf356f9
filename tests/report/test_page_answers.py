"""The page's answers say what the tables say."""

from __future__ import annotations

import re

import numpy as np
import run_files

from stseg.records.ghost_reasons import ghost_reasons
from stseg.records.tables import EVENT, Tracks
from stseg.reporting.page.answers import answers
from stseg.reporting.pictures.maps import DwellPlace
from stseg.reporting.run_statistics import Span

PLACES = [DwellPlace(1.0, 2.0, 0.4), DwellPlace(-1.0, 0.0, 0.2)]


def answers_of(places: list[DwellPlace], shares: list[float], dropped: int = 0) -> list[str]:
    """The four answers of the small run, without their tags."""
    trajectory, candidates = run_files.small_trajectory(), run_files.small_ghosts()
    events = np.zeros(dropped, EVENT)
    events["kind"] = b"dropped"
    found = answers(
        Span(10, 16, 5.0), 6, trajectory, Tracks(trajectory).summary(), events, len(candidates),
        ghost_reasons(candidates), places, np.array(shares),
    )  # fmt: skip
    assert [question for question, _ in found] == [
        "How many people?", "Where do they dwell?", "What was dropped as a ghost, and why?", "Where is the rig blind?",
    ]  # fmt: skip
    return [re.sub("<[^>]+>", "", answer) for _, answer in found]


def test_the_four_questions_are_answered() -> None:
    people, places, ghosts, blind = answers_of(
        [DwellPlace(1.0, 2.0, 0.4), DwellPlace(-1.0, 0.0, 0.2)], [0.1, 0.25, 0.65], 2
    )
    assert people.startswith("1.5 at a time on average, at most 2. There are 2 tracks, half of them 0.9 s or longer")
    assert "A at (1.0, 2.0), 40 %; B at (-1.0, 0.0), 20 %" in places
    assert ghosts.startswith("1 of 3 candidates (0.2 a frame): 100 % because a view sees nobody there.")
    assert ghosts.endswith("2 tracks too short or too uncertain were dropped as well.")
    assert blind.startswith("10 % of the ground is seen by no view, 25 % by one alone") and "65 % by two" in blind


def test_an_even_crowd_dwells_nowhere() -> None:
    _, places, ghosts, _ = answers_of([], [0, 0, 1])
    assert places.startswith("Nowhere in particular")
    assert "too short" not in ghosts
