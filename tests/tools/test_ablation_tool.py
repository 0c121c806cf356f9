"""The plain methods and the ablation of tools/experiments."""

from __future__ import annotations

import importlib
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from scenes import CONFIG, box_moments, room, walkers

from stseg.config import TrackingConfig
from stseg.detection.score.scoring import set_score
from stseg.engine.pipeline import Pipeline
from stseg.engine.session import run_session
from stseg.evaluation import evaluate
from stseg.foreground.view_foreground import ViewForeground
from stseg.kernels.accelerate import python_form
from stseg.records.tables import APPEARANCE

ROOT = Path(__file__).parents[2]
INTERPRETED = python_form(set_score) is set_score


@pytest.fixture
def plain_methods(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(ROOT / "tools")
    return importlib.import_module("experiments.plain_methods")


@pytest.fixture
def ablation(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(ROOT / "tools")
    return importlib.import_module("experiments.ablation")


def test_components_are_linked_within_walking_distance(plain_methods: ModuleType) -> None:
    """Two pass each other; one is missed in a frame, another appears beyond walking distance."""
    found = [np.array([[0.1 * t, 0.0], [1.0 - 0.1 * t, 0.8]]) for t in range(8)]
    found[3] = found[3][1:]
    found[5] = np.concatenate([found[5][::-1], [[3.0, 3.0]]])
    table = plain_methods.link(found, 10, replace(room(), frame_rate=8.0), TrackingConfig())
    assert table["frame"].tolist() == sorted(10 + t for t in range(8) for _ in found[t])
    assert table["id"].tolist() == [1, 2, 1, 2, 1, 2, 2, 1, 2, 2, 1, 3, 1, 2, 1, 2]


def test_an_absence_beyond_patience_ends_a_track(plain_methods: ModuleType) -> None:
    nothing, here = np.zeros((0, 2)), np.zeros((1, 2))
    patience = TrackingConfig().patience
    for away, names in ((int(8 * patience) - 1, [1, 1]), (int(8 * patience) + 1, [1, 2])):
        found = [here, *[nothing] * away, here]
        assert plain_methods.link(found, 0, room(), TrackingConfig())["id"].tolist() == names
    assert len(plain_methods.link([nothing, nothing], 0, room(), TrackingConfig())) == 0


@pytest.mark.skipif(INTERPRETED, reason="a whole run needs the compiler")
def test_two_labels_track_isolated_people(ablation: ModuleType) -> None:
    rig, truth = room(), walkers(40)
    del ablation
    pipeline = Pipeline(rig, ["boxes"] * 4, CONFIG, "two labels")
    done: list[int] = []
    commits = [
        step.commit
        for step in run_session(
            pipeline, [ViewForeground() for _ in rig.cameras], box_moments(rig, truth, 0, 20), 0, done.append
        )
    ]
    rows, events = (np.concatenate([getattr(c, name) for c in commits]) for name in ("trajectory", "events"))
    tracks, _ = pipeline.finished(rows, events, np.zeros(0, APPEARANCE))
    scores = evaluate(truth[truth["frame"] < 20], tracks.trajectory)
    assert (scores.switches, scores.misses, scores.false_alarms) == (0, 0, 0)
