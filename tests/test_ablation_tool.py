"""tools/ablation.py: the ways it sets beside each other, the page it writes."""

from __future__ import annotations

import importlib
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from scenes import CONFIG, box_moments, room, walkers

from stseg.accelerate import python_form
from stseg.config import IdentityConfig
from stseg.detection.scoring import set_score
from stseg.engine.pipeline import Pipeline
from stseg.evaluation import evaluate
from stseg.foreground.view_foreground import ViewForeground

ROOT = Path(__file__).parents[1]
INTERPRETED = python_form(set_score) is set_score


@pytest.fixture
def ways(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(ROOT / "tools")
    return importlib.import_module("ablation_ways")


@pytest.fixture
def page(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(ROOT / "tools")
    return importlib.import_module("ablation_page")


def test_components_are_linked_to_who_can_have_walked_there(ways: ModuleType) -> None:
    """Two pass each other; one is unseen for a frame, another comes where nobody could have walked to."""
    found = [np.array([[0.1 * t, 0.0], [1.0 - 0.1 * t, 0.8]]) for t in range(8)]
    found[3] = found[3][1:]
    found[5] = np.concatenate([found[5][::-1], [[3.0, 3.0]]])
    table = ways.link(found, 10, replace(room(), frame_rate=8.0), IdentityConfig())
    assert table["frame"].tolist() == sorted(10 + t for t in range(8) for _ in found[t])
    assert table["id"].tolist() == [1, 2, 1, 2, 1, 2, 2, 1, 2, 2, 1, 3, 1, 2, 1, 2]


def test_who_was_away_too_long_is_somebody_new(ways: ModuleType) -> None:
    nothing, here = np.zeros((0, 2)), np.zeros((1, 2))
    patience = IdentityConfig().patience
    for away, names in ((int(8 * patience) - 1, [1, 1]), (int(8 * patience) + 1, [1, 2])):
        found = [here, *[nothing] * away, here]
        assert ways.link(found, 0, room(), IdentityConfig())["id"].tolist() == names
    assert len(ways.link([nothing, nothing], 0, room(), IdentityConfig())) == 0


@pytest.mark.skipif(INTERPRETED, reason="a whole run needs the compiler")
def test_two_labels_follow_who_is_alone(ways: ModuleType) -> None:
    rig, truth = room(), walkers(40)
    del ways
    pipeline = Pipeline(rig, [ViewForeground() for _ in rig.cameras], ["boxes"] * 4, CONFIG, "two labels")
    done: list[int] = []
    commits = [step.commit for step in pipeline.steps(box_moments(rig, truth, 0, 20), 0, done.append)]
    rows, events = (np.concatenate([getattr(c, name) for c in commits]) for name in ("trajectory", "events"))
    tracks, _ = pipeline.finished(rows, events)
    scores = evaluate(truth[truth["frame"] < 20], tracks.trajectory)
    assert (scores.switches, scores.misses, scores.false_alarms) == (0, 0, 0)


def scores_of(moda: float) -> dict[str, Any]:
    return {
        "MODA": moda,
        "precision": 90.0,
        "recall": None,
        "IDF1": 80.0,
        "IDSW": 3,
        "Frag": 1,
        "false_tracks": 0,
    }


def test_the_page_tells_what_was_measured(page: ModuleType) -> None:
    text = "\n".join(
        f"around {name}\n<!-- {name}: begin, written by tools/ablation.py -->\nold\n<!-- {name}: end -->"
        for name in ("ways", "last look", "smoothness", "commits")
    )
    common = {"set": "yard", "views": 4, "commit": "abc"}
    figures = [
        {**common, "part": "views", "way": "cut", "committed": scores_of(70.0), "finished": scores_of(75.5)},
        {**common, "part": "views", "way": "threshold", "level": -0.7, "finished": scores_of(50.0)},
        *({**common, "part": "smoothness", "smoothness": s, "finished": scores_of(70 + s)} for s in (0.4, 0.1, 0.2)),
    ]
    made = page.rewrite(text, figures)
    assert "\nold\n" not in made
    order = [
        "threshold -0.7 | 50.0 | 90.0 | - | 80.0 | 3 | 1 | 0 |",
        "cut | 75.5 |",
        "| 70.0 | 75.5 |",
        "| 0.1 | 70.1 |",
        "0.30 |",
        "`abc`",
    ]
    found = [made.find(part) for part in order]
    assert min(found) >= 0
    assert all(a < b for a, b in pairwise(found))
    assert page.rewrite(made, figures) == made
    with pytest.raises(SystemExit, match="marked 'ways'"):
        page.rewrite("nothing marked", figures)
