"""Where candidates come from: every source finds people, duplicates are one, and the pass takes what is proposed."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
import scenes
from checks import in_ci

from stseg.arrays import ViewEvidence
from stseg.baselines.huang_wang_2012.proposals import Fuse, Proposals, empty_explanation, marginal
from stseg.config import ProposalConfig
from stseg.engine.pipeline import Pipeline, find_candidate_source
from stseg.engine.session import run_session
from stseg.foreground.view_foreground import ViewForeground
from stseg.occupancy.volume import Occupancy
from stseg.records.candidates import Candidates

Asked = Literal["lattice", "probability", "volume", "both"]
VIEWS = scenes.corner_cameras()
RIG = scenes.rig_of(VIEWS, cell=0.2, planes=5)
STANDING = scenes.people((-1.0, -0.6), (0.9, 0.7), (1.0, -1.1))
FEW = ProposalConfig(body_sizes=3, lattice_spacing=0.25)


def evidence(kind: str) -> list[ViewEvidence]:
    return scenes.evidence_of(kind, VIEWS, STANDING)


def candidates(kind: str, asked: Asked) -> Proposals:
    return Proposals(RIG, [kind] * 4, replace(scenes.CONFIG, proposals=replace(FEW, source=asked)))


def fuse(kind: str) -> Fuse:
    occupancy = Occupancy(RIG, [kind] * 4, scenes.CONFIG.occupancy, scenes.FEW_HEIGHTS, scenes.BODY)
    return lambda seen, explanation: occupancy.fuse(seen, explanation).dense()


def pool(*places: tuple[float, float]) -> Candidates:
    ones = np.ones(len(places))
    return Candidates(np.array(places, float).reshape(-1, 2), 1.7 * ones, 0.42 * ones)


@pytest.mark.parametrize("kind", ("boxes", "pixels"))
@pytest.mark.parametrize("asked", ("probability", "volume", "both"))
def test_each_source_finds_everybody(kind: str, asked: Asked) -> None:
    found = candidates(kind, asked).of(evidence(kind), fuse(kind))
    away = np.hypot(*np.moveaxis(found.ground[:, None] - STANDING[:, :2], -1, 0))
    # What boxes say of a place in a volume reaches far to its sides: their modes are no better than the pass's lattice.
    assert (away.min(0) < (0.5 if kind == "boxes" and asked == "volume" else 0.25)).all()
    apart = np.hypot(*np.moveaxis(found.ground[:, None] - found.ground, -1, 0))
    assert (apart[np.triu_indices(len(found), 1)] >= scenes.FEW_HEIGHTS.lattice_spacing).all()


def test_lattices_sources_and_volumes_propose_no_duplicates() -> None:
    assert find_candidate_source(RIG, ["pixels"] * 4, scenes.CONFIG) is None
    seen = evidence("pixels")
    volume, both = (candidates("pixels", asked).of(seen, fuse("pixels")) for asked in ("volume", "both"))
    np.testing.assert_array_equal(both.ground[: len(volume)], volume.ground)
    occupancy = Occupancy(RIG, ["pixels"] * 4, scenes.CONFIG.occupancy, scenes.FEW_HEIGHTS, scenes.BODY)
    filled = marginal(occupancy.fuse(seen, empty_explanation(occupancy.rig, seen)).dense())
    away = np.hypot(*np.moveaxis(RIG.grid.ground[:, :, None] - STANDING[:, :2], -1, 0)).min(-1)
    assert filled[away < 0.12].min() > 0.5 and filled[away > 0.8].max() < 0.1


@pytest.mark.parametrize(
    "seen", ([None] * 4, [scenes.no_boxes()] * 4, [None, scenes.no_boxes(), None, scenes.no_boxes()])
)
def test_where_nothing_is_seen_nobody_is_proposed(seen: Sequence[ViewEvidence]) -> None:
    assert len(candidates("boxes", "both").of(list(seen), fuse("boxes"))) == 0


def test_duplicates_are_dropped_in_order_expected_ones_first() -> None:
    known, other = pool((0.0, 0.0), (1.0, 0.0)), pool((0.1, 0.0), (0.5, 0.5), (0.55, 0.5), (1.0, 0.3))
    merged = known.joined_if_distant(other, 0.25)
    np.testing.assert_array_equal(merged.ground, [[0.0, 0.0], [1.0, 0.0], [0.5, 0.5], [1.0, 0.3]])
    assert len(pool().joined_if_distant(known, 0.25)) == 2
    assert len(pool((0.0, 0.0), (0.05, 0.0)).joined_if_distant(pool(), 0.25)) == 2
    taller = Candidates(known.ground, known.height + np.array([0.0, 0.1]), known.width)
    np.testing.assert_array_equal(taller.new_to(known).ground, [[1.0, 0.0]])
    assert len(known.new_to(known)) == 0 and len(known.new_to(pool())) == 2
    frame_pass = scenes.detector_of(RIG, "pixels")
    expected = scenes.expecting(*STANDING.tolist())
    proposed = pool(*(tuple(place + 0.05) for place in STANDING[:, :2]))
    found = frame_pass.explain(evidence("pixels"), expected, proposed).people
    assert sorted(found.track_index) == [0, 1, 2]


@pytest.mark.parametrize("kind", ("boxes", "pixels"))
def test_detection_keeps_people_of_proposals_and_drops_others(kind: str) -> None:
    frame_pass = scenes.detector_of(RIG, kind)
    proposed = pool(*(tuple(place) for place in STANDING[:, :2]), (-1.5, 1.5), (0.0, 1.6))
    plain, given = (frame_pass.explain(evidence(kind), None, asked).people for asked in (None, proposed))
    assert len(plain) == len(given) == len(STANDING)
    away = np.hypot(*np.moveaxis(given.ground[:, None] - STANDING[:, :2], -1, 0))
    assert away.min(1).max() < 0.15


@pytest.mark.parametrize("asked", ["both", *in_ci("probability", "volume")])
@pytest.mark.parametrize("kind", ("boxes", "pixels"))
def test_the_pipeline_finds_the_same_people_by_any_source(kind: str, asked: Asked) -> None:
    rig, truth = scenes.room(), scenes.walkers(2)
    moments = list((scenes.box_frame_sets if kind == "boxes" else scenes.mask_frame_sets)(rig, truth, 0, 2))
    config = replace(scenes.CONFIG, proposals=replace(FEW, source=asked))
    pipeline = Pipeline(rig, [kind] * 4, config, "frames")
    steps = run_session(pipeline, [ViewForeground()] * 4, moments, 0, lambda _: None)
    rows = np.concatenate([step.commit.trajectory for step in steps])
    for frame in range(2):
        own, standing = rows[rows["frame"] == frame], scenes.standing_at(truth, frame)
        assert len(own) == len(standing)
        away = np.hypot(own["x"][:, None] - standing[:, 0], own["y"][:, None] - standing[:, 1])
        assert away.min(1).max() < 0.3
