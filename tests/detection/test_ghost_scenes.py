"""Named scenes in which views contradict each other: ghosts, and unexplained pixels."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scenes import (
    BODY,
    CONFIG,
    FEW_HEIGHTS,
    boxes,
    corner_cameras,
    detector_of,
    evidence_of,
    expecting,
    looking,
    mask,
    people,
    rig_of,
)

from stseg import CommittedFrames, FrameSet, Rig
from stseg.arrays import Floats, Shorts, Singles
from stseg.detection.detector import Detector
from stseg.detection.evidence.pillar_evidence import fill_scores
from stseg.detection.evidence.unexplained_pixels import UnexplainedPixels
from stseg.detection.prior import Prior
from stseg.engine.pipeline import Pipeline
from stseg.engine.session import run_session
from stseg.foreground.view_foreground import ViewForeground
from stseg.geometry.distances import distances
from stseg.records.people import Explanation
from stseg.records.tables import Tracks
from stseg.tracking.filter.assignment import assign
from stseg.tracking.filter.track_filter import TrackFilter
from stseg.trajectories.final_tracks import CommittedRows

KINDS = ("pixels", "boxes")
FRAMES = 20

FIGURE_4 = people((-1.0, -1.0), (1.0, 1.0))
"""HW12 figure 4: two cameras whose lines of sight to two people cross in four places."""
FIGURE_4_GHOSTS = np.array([[0.5, -1.5], [-1.5, 0.5]])
"""Where they cross without a person, so near to the cameras that the bodies would be small."""
FIVE = (
    people((-1.2, -0.3, 1.75), (-0.2, 1.2, 1.6), (0.4, -1.1, 1.8), (1.3, 0.5), (0.3, 0.2, 1.65)),
    people((1.2, -1.3), (-0.3, -0.6, 1.8), (0.4, 1.4, 1.65), (-1.4, 0.7, 1.75), (-1.1, -1.4, 1.6)),
)
"""Five people in the room, who hide each other in most views."""
GHOSTS = {("pixels", 2): 5, ("pixels", 3): 3, ("pixels", 4): 2}
"""Ghosts that so many views make of them in a first frame, at least."""


def facing_pair() -> Rig:
    """The rig of figure 4: one camera looks east, one north."""
    return rig_of([looking("west", (-4.0, 0.0, 2.2)), looking("south", (0.0, -4.0, 2.2))])


@cache
def pass_of(kind: str, cameras: int) -> Detector:
    """The pass under the first corner cameras."""
    return detector_of(rig_of(corner_cameras()[:cameras]), kind)


def assert_these(explanation: Explanation, standing: Floats, ghosts: int = 0) -> None:
    """Assert that just these people were found, and at least so many ghosts rejected."""
    found = explanation.people.ground
    who, _ = assign(distances(standing[:, :2], found), 0.25)
    assert len(who) == len(standing) == len(found), found
    assert len(explanation.ghosts) >= ghosts and (explanation.ghosts.evidence < 0).all()


@pytest.mark.parametrize("kind", KINDS)
def test_figure_4(kind: str) -> None:
    rig = facing_pair()
    explanation = detector_of(rig, kind).explain(evidence_of(kind, rig.cameras, FIGURE_4), None)
    # A box knows how far away its person is, so its lines of sight cross nowhere else.
    assert_these(explanation, FIGURE_4, ghosts=2 if kind == "pixels" else 0)
    assert distances(FIGURE_4[:, :2], explanation.people.ground).min(1).max() < 0.2
    assert explanation.ghosts.view_evidence.shape == (2, len(explanation.ghosts))
    if kind == "pixels":
        away = distances(explanation.ghosts.ground, FIGURE_4_GHOSTS)
        assert (away.min(0) < 0.6).all() and (away.min(1) < 0.6).all()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("cameras", [2, 3, 4])
@pytest.mark.parametrize("scene", [0, 1])
def test_five_people(kind: str, cameras: int, scene: int) -> None:
    """At once in a first frame without tracks, and again with their tracks."""
    standing, frame_pass = FIVE[scene], pass_of(kind, cameras)
    views = evidence_of(kind, corner_cameras()[:cameras], standing)
    assert_these(frame_pass.explain(views, None), standing, GHOSTS.get((kind, cameras), 0))
    assert_these(frame_pass.explain(views, expecting(*standing + np.array([0.06, -0.05, 0]))), standing)


def strollers(frame: int) -> Floats:
    """Two who walk side by side, north-east, through the rig of figure 4: their ghosts walk with them."""
    step = 0.05 * frame
    return people((-1.3 + step, -1.0 + step), (0.4 + step, 0.5 + step))


def crossings(standing: Floats, rig: Rig) -> Floats:
    """Where the lines of sight of the two cameras to two people cross without a person, float64 (2, 2)."""
    west, south = (camera.centre[:2] for camera in rig.cameras)
    found = []
    for one, other in ((0, 1), (1, 0)):
        a, b = standing[one, :2] - west, standing[other, :2] - south
        share = np.linalg.solve(np.column_stack([a, -b]), south - west)[0]
        found.append(west + share * a)
    return np.array(found)


@cache
def moving_ghosts(kind: str) -> tuple[list[CommittedFrames], Tracks]:
    """Committed frames and tracks of the strollers, from frame 0 on, by the whole pipeline."""
    rig = facing_pair()
    pipeline = Pipeline(rig, [kind] * 2, CONFIG, "cut")
    show = mask if kind == "pixels" else boxes
    frames = [FrameSet(f, tuple(show(camera, strollers(f)) for camera in rig.cameras)) for f in range(FRAMES)]
    steps = list(run_session(pipeline, [ViewForeground()] * 2, frames, 0, lambda _: None))
    rows, events = (np.concatenate([getattr(s.commit, name) for s in steps]) for name in ("trajectory", "events"))
    committed = CommittedRows(rows, events, np.concatenate([s.appearance for s in steps]))
    return steps, pipeline.finished(committed)[0]


@pytest.mark.parametrize("kind", KINDS)
def test_a_ghost_that_moves_with_its_makers(kind: str) -> None:
    """However long it is borne out, it never becomes a track."""
    rows = moving_ghosts(kind)[1].trajectory
    assert np.unique(rows["id"]).tolist() == [1, 2] and len(rows) == 2 * FRAMES
    for row in rows:
        away = np.hypot(*(strollers(row["frame"])[:, :2] - [row["x"], row["y"]]).T)
        assert away.min() < 0.3


def test_the_moving_ghost_is_borne_out_and_not_picked_up() -> None:
    """It was there to be picked up: taken by itself it is worth a person, in nearly every frame."""
    rig, worth = facing_pair(), 0
    frame_pass = detector_of(rig, "pixels")
    config = frame_pass.config
    nothing_known = Prior.of(None, config, frame_pass.body, frame_pass.border)
    ground = frame_pass.lattice_ground.reshape(-1, 2)
    for frame in range(FRAMES):
        views = frame_pass.observe(evidence_of("pixels", rig.cameras, strollers(frame)))
        score = np.zeros((3, len(ground)))
        evidence, lattice = frame_pass.evidence(views, nothing_known), frame_pass.pixel_lattice
        no_owner = np.full(int(lattice.shapes.prod(1).sum()), -1, np.int16)
        pixels = UnexplainedPixels.of(evidence.rasters, no_owner, lattice, evidence.extremes)
        weight = config.effective_observations
        fill_scores(pixels, lattice, np.array([1]), np.zeros(0, np.int64), -np.inf, weight, score)
        here = distances(ground, crossings(strollers(frame), rig)).min(1) < 0.3
        worth += score[1, here].max() > -config.prior_log_odds
    assert worth > 0.8 * FRAMES
    # Its cells hold the unexplained evidence, which is none: they stay free.
    rig, radius = facing_pair(), 0.35
    for step in moving_ghosts("pixels")[0]:
        for scene, label in zip(step.commit.frames, step.commit.label, strict=True):
            standing = strollers(scene.frame)
            for ghost in crossings(standing, rig):
                cells = np.hypot(*np.moveaxis(rig.grid.ground - ghost, -1, 0)) < radius
                cells &= np.hypot(*np.moveaxis(rig.grid.ground[..., None, :] - standing[:, :2], -1, 0)).min(-1) > 0.6
                assert not label[:, cells].any(), (scene.frame, ghost)


@pytest.mark.parametrize("kind", KINDS)
def test_somebody_hidden_from_all_views_but_one_stays(kind: str) -> None:
    """Seen by all at first; then three taller people step between them and three of the cameras, and stand there."""
    rig, follow = rig_of(corner_cameras()), TrackFilter(8.0, CONFIG)
    hidden, who = people((0.0, 0.0, 1.6)), set[int]()
    for frame in range(FRAMES):
        side = max(1.2 - 0.1 * frame, 0.0)
        corners = (-0.45 + side, -0.45 - side), (0.45 + side, -0.44 + side), (0.44 - side, 0.45 + side)
        nearer = people(*((x, y, 1.9) for x, y in corners))
        standing = np.concatenate([hidden, nearer])
        views = evidence_of(kind, rig.cameras, standing)
        if kind == "boxes" and side < 0.2:
            views[:3] = [boxes(camera, nearer) for camera in rig.cameras[:3]]
        found = pass_of(kind, 4).explain(views, follow.predict(frame))
        chains = follow.update(frame, found.people, found.ghosts)
        away = distances(found.people.ground, hidden[:, :2])[:, 0]
        off, covariance = (array[away.argmin()] for array in (found.people.ground, found.people.covariance))
        assert off @ np.linalg.solve(covariance, off) < 2.0, (frame, found.people.ground)
        assert away.min() < (0.25 if kind == "pixels" else 0.35), "one box places a person along its ray"
        assert len(chains) == 4
        who.add(int(chains[away.argmin()]))
    assert len(who) == 1


@pytest.mark.parametrize(("kind", "number"), [("pixels", 2), ("pixels", 3), ("boxes", 3)])
def test_a_child_comes_to_light(kind: str, number: int) -> None:
    """No frame is sure of one who appears between adults, but the evidence of few frames adds up."""
    rig, body = rig_of(corner_cameras()[3 - number : 3]), replace(BODY, heights=(1.0, 1.25, 1.6, 1.7, 1.8))
    detector, follow = Detector(rig, [kind] * number, FEW_HEIGHTS, body), TrackFilter(8.0, replace(CONFIG, body=body))
    adults, child = people((-1.0, -0.6), (1.0, 0.9, 1.8)), people((0.0, 0.8, 1.0))
    for frame, standing in enumerate([adults, adults, *[np.concatenate([adults, child])] * 3]):
        views = evidence_of(kind, rig.cameras, standing)
        found = detector.explain(views, follow.predict(frame))
        follow.update(frame, found.people, found.ghosts, views)
    assert_these(found, standing)
    assert found.people.height.min() < 1.3


BACKGROUND = np.float32(-2.2)
DETECTOR = detector_of(rig_of(corner_cameras(), cell=0.5, planes=3), "pixels")
LATTICE = DETECTOR.pixel_lattice
CELLS = DETECTOR.lattice_ground[..., 0].size
WEIGHT, SCORE_BEFORE = 0.5, 4.2


def nothing() -> Singles:
    return np.full((4, *LATTICE.shapes.max(0)), BACKGROUND)


def scene(seed: int) -> tuple[Singles, Shorts]:
    """Log-odds of background with some foreground in it, and a member who explains pixels next to it."""
    rng = np.random.default_rng(seed)
    rasters, owner = nothing(), np.full((4, *LATTICE.shapes.max(0)), -1, np.int16)
    row, column = rasters.shape[1] // 2, rasters.shape[2] // 2
    rasters[:, row : row + 9, column : column + 5] = rng.normal(1, 1, (4, 9, 5)).clip(-2, 2)
    owner[:, row - 6 : row, column + 4 : column + 9] = 0
    parts = [pillar[: shape[0], : shape[1]].reshape(-1) for pillar, shape in zip(owner, LATTICE.shapes, strict=True)]
    return rasters, np.concatenate(parts)


def by_definition(rasters: Singles, owner: Shorts, before: float) -> Floats:
    """Sums over all views of the mean log-odds of open pixels over each outline, (height, cell)."""
    outlines, mean, start = LATTICE.outlines, np.zeros((4, 3 * CELLS)), 0
    for view, (rows, columns) in enumerate(LATTICE.shapes.tolist()):
        own_view = owner[start : start + rows * columns].reshape(rows, columns)
        is_shown = np.where(own_view < 0, rasters[view, :rows, :columns], 0.0).astype(float)
        start += rows * columns
        for pillar in range(3 * CELLS):
            i = view * 3 * CELLS + pillar
            spans = outlines.spans[outlines.start[i] : outlines.start[i + 1]]
            total = sum(is_shown[outlines.first[i] + k, a:b].sum() for k, (a, b) in enumerate(spans.tolist()))
            mean[view, pillar] = total / outlines.area[i] if len(spans) else 0.0
    return np.asarray(before + WEIGHT * mean.sum(0).reshape(3, CELLS))


def scores(rasters: Singles, owner: Shorts, minimum_probe_score: float, before: float = SCORE_BEFORE) -> Floats:
    extremes = np.tile([rasters.min(), rasters.max()], (4, 1)).astype(float)
    score = np.full((3, CELLS), before)
    pixels = UnexplainedPixels.of(rasters, owner, LATTICE, extremes)
    fill_scores(pixels, LATTICE, np.array([1]), np.array([0, 2]), minimum_probe_score, WEIGHT, score)
    return score


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("minimum_probe_score", [-np.inf, -1.0])
@pytest.mark.parametrize("before", [SCORE_BEFORE, 3.0])
def test_scores_by_definition_where_they_matter(seed: int, minimum_probe_score: float, before: float) -> None:
    """A cell matters where one of its heights scores above 0."""
    found, expected = scores(*scene(seed), minimum_probe_score, before), by_definition(*scene(seed), before)
    is_evaluated = np.isfinite(found)
    np.testing.assert_allclose(found[is_evaluated], expected[is_evaluated], atol=1e-9)
    worth, matters = expected[1] > minimum_probe_score, (expected > 0).any(0)
    assert is_evaluated[1, worth & matters].all() and is_evaluated[:, worth][expected[:, worth] > 0].all()
    assert not is_evaluated[::2, ~worth].any() and matters.any()
    assert is_evaluated.any(0).mean() < 1.0


def test_whatever_is_shown_is_noticed() -> None:
    """Each pixel inside some outline counts, whether it is foreground or a member's."""
    no_owner = np.full(int(LATTICE.shapes.prod(1).sum()), -1, np.int16)
    silent = scores(nothing(), no_owner, -np.inf)[1]
    row, column = LATTICE.shapes[0] // 2
    bright, explained = nothing(), no_owner.copy()
    bright[0, row, column] = 1
    explained[row * LATTICE.shapes[0, 1] + column] = 0
    for score in (scores(bright, no_owner, -np.inf)[1], scores(nothing(), explained, -np.inf)[1]):
        assert 0 < (score != silent).sum() < score.size / 2 and (score >= silent).all()
