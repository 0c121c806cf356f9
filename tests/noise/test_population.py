"""The population prior: by its formulas, from what a run shows, and from the rig file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scenes import BODY, FEW_HEIGHTS, corner_cameras, found, likelihoods, people, rig_of, room

from stseg.config import BodyConfig, Config, DetectionConfig, ErrorRateConfig
from stseg.detection.detector import Detector
from stseg.engine.rig_body import with_body_of
from stseg.errors import ConfigError, RigError
from stseg.io.recording.recording import BodyPrior, CameraSource, Recording, Source
from stseg.io.recording.rig_text import format_rig
from stseg.io.recording.rigs import parse_rig
from stseg.noise.population_estimate import PopulationEstimate
from stseg.records.people import People

RATE = 8.0
LASTING = ErrorRateConfig(memory=1e9)


def sized(heights: list[float], widths: list[float], unresolved: float = 0.0, evidence: float = 6.0) -> People:
    """People whose sizes a frame left open by a share of the default population's variance."""
    n, body = len(heights), BodyConfig()
    seen = found(people(*[(0.1 * k, 0.0) for k in range(n)]), evidence=evidence)
    variances = (np.full(n, unresolved * spread**2) for spread in (body.height_spread, body.width_spread))
    tall, wide = variances
    return replace(seen, sizes=replace(seen.sizes, height=np.array(heights), height_variance=tall,
                                       width=np.array(widths), width_variance=wide))  # fmt: skip


def learned(frames: list[People], config: ErrorRateConfig = LASTING) -> BodyConfig:
    estimate = PopulationEstimate(BodyConfig(), RATE, config)
    for frame in frames:
        estimate.learn(frame)
    return estimate.body


def test_means_and_spreads_by_the_formulas() -> None:
    heights, body = np.array([1.0, 1.2, 1.8]), BodyConfig()
    after = learned([sized(heights.tolist(), (0.25 * heights).tolist())] * 400)
    weight, before = 400 / RATE, body.prior_weight
    mean = (before * body.height_mean + weight * heights.sum()) / (before + 3 * weight)
    spread = before * (body.height_spread**2 + (body.height_mean - mean) ** 2) + weight * ((heights - mean) ** 2).sum()
    assert after.height_mean == pytest.approx(mean)
    assert after.height_spread == pytest.approx(np.sqrt(spread / (before + 3 * weight)))
    share = body.width_mean / body.height_mean
    relative = (before * share + 3 * weight * 0.25) / (before + 3 * weight)
    assert after.width_mean == pytest.approx(relative * mean)
    assert after.width_spread >= body.width_spread


def test_nothing_seen_teaches_nothing() -> None:
    for frame in (sized([], []), sized([1.0], [0.2], unresolved=1.0), sized([1.0], [0.2], evidence=1.0)):
        after = learned([frame] * 20)
        np.testing.assert_allclose(
            [after.height_mean, after.height_spread, after.width_mean, after.width_spread],
            [1.7, 0.12, 0.42, 0.04],
        )


def test_people_alike_leave_the_least_spread_and_are_forgotten() -> None:
    alike = sized([1.7, 1.7], [0.42, 0.42])
    assert learned([alike] * 500).height_spread == BodyConfig().height_spread
    small = [sized([1.0], [0.25])] * 200
    config = ErrorRateConfig(memory=5.0)
    assert learned(small, config).height_mean < 1.6
    assert learned([*small, *[sized([], [])] * 400], config).height_mean == pytest.approx(1.7, abs=1e-3)


def test_a_run_among_children_learns_their_height() -> None:
    rig = room()
    standing = {"children": [(-0.9, 0.4, 1.2), (0.6, -0.5, 1.15)], "adults": [(-0.9, 0.4, 1.72), (0.6, -0.5, 1.68)]}
    means = {}
    for who, places in standing.items():
        asked = Detector(rig, ["pixels"] * 4, FEW_HEIGHTS, replace(BODY, heights=(1.1, 1.4, 1.7)))
        estimates = asked.new_estimates()
        for _ in range(40):
            explained = asked.explain_next(estimates, 0, likelihoods(rig.cameras, people(*places)), None)
        assert len(explained.people) == 2
        means[who] = estimates.population.body.height_mean
    assert means["children"] < 1.62
    assert means["adults"] == pytest.approx(1.7, abs=0.04)


def recording(body: BodyPrior) -> Recording:
    cameras = corner_cameras()
    sources = tuple(CameraSource(Source("masks", Path(f"{camera.name}.avi"))) for camera in cameras)
    return Recording(Path("rig.toml"), rig_of(cameras), sources, body)


def test_the_rigs_bodies_are_kept_in_its_file() -> None:
    for body in (BodyPrior(), BodyPrior(height_mean=0.6), BodyPrior(0.6, 0.05, 0.5, 0.1)):
        text = format_rig(recording(body), Path("rig.toml"))
        assert ("[body]" in text) == (body != BodyPrior())
        assert parse_rig(text, Path("rig.toml")).body == body


@pytest.mark.parametrize(
    ("line", "key"),
    [
        ("height_mean = -1", "height_mean"),
        ("heights = 1", "heights"),
        ("width_mean = 0.3\nwidth_spread = 0.2", "width_spread"),
    ],
)
def test_the_rigs_bodies_are_checked(line: str, key: str) -> None:
    text = format_rig(recording(BodyPrior()), Path("rig.toml")) + f"\n[body]\n{line}\n"
    with pytest.raises(RigError, match=key):
        parse_rig(text, Path("rig.toml"))


def test_the_configuration_precedes_the_rig_as_a_prior() -> None:
    dogs = recording(BodyPrior(height_mean=0.6, width_mean=0.5))
    assert with_body_of(recording(BodyPrior()), Config()) == Config()
    body = with_body_of(dogs, Config()).body
    assert (body.height_mean, body.width_mean) == (0.6, 0.5)
    assert body.height_spread == pytest.approx(0.6 * 0.12 / 1.7)
    assert with_body_of(dogs, Config()).detection.minimum_distance == pytest.approx(0.3 * 0.5 / 0.42)
    told = Config(detection=DetectionConfig(minimum_distance=0.2))
    assert with_body_of(dogs, told).detection.minimum_distance == 0.2
    assert min(body.heights) < 0.6 < max(body.heights) < 0.8
    configured = with_body_of(dogs, Config(body=BodyConfig(height_mean=0.9, heights=(0.8, 1.0)))).body
    assert (configured.height_mean, configured.heights, configured.width_mean) == (0.9, (0.8, 1.0), 0.5)
    with pytest.raises(ConfigError, match="height_mean"):
        with_body_of(dogs, Config(body=BodyConfig(height_spread=0.4)))
