"""The tracker `particles`: each equation of KD06 against a plain one, and people followed by the colours of clothes."""

from dataclasses import replace

import numpy as np
import pytest
import reference_particles as plain
from checks import compiled_only, drawn
from coloured_people import RIG, SHIRTS, follow, frame_of, observations_of, painted, rows_of
from hypothesis import strategies as st
from scenes import CONFIG, SIZE, corner_cameras, looking, mask, people

from stseg.arrays import Floats, Rows, Singles
from stseg.baselines.colour_views import colour_views
from stseg.baselines.kim_davis_2006.appearance import SAMPLES, PersonAppearance
from stseg.baselines.kim_davis_2006.axes import HYPOTHESIS_WEIGHT, _middle_of_shortest_half, fill_axes, intersect_axes
from stseg.baselines.kim_davis_2006.bodies import HALF_WIDTH, PARTS, fill_bodies, fill_boxes
from stseg.baselines.kim_davis_2006.colours import BINS, FALL, bins_of, fill_density, histogram, normalised
from stseg.baselines.kim_davis_2006.filter import estimate, particle_weights, resampled
from stseg.baselines.kim_davis_2006.likelihood import NEUTRAL, add_misfit
from stseg.baselines.kim_davis_2006.search import search
from stseg.baselines.kim_davis_2006.segmentation import NO_PERSON, Canvas, fill_unoccluded, segment
from stseg.baselines.kim_davis_2006.tracker import ParticleTracker
from stseg.baselines.kim_davis_2006.views import ParticleView
from stseg.config import Config, ParticleConfig
from stseg.geometry import Camera
from stseg.kernels.accelerate import COMPILED
from stseg.trackers import FrameObservations

CAMERA = corner_cameras()[0]


def bodies_of(camera: Camera, standing: Floats) -> Floats:
    bodies = np.zeros((len(standing), 5))
    fill_bodies(camera.projection, camera.centre, standing[:, :2].copy(), standing[:, 2].copy(), bodies)
    return bodies


def raster(camera: Camera, step: int = 6) -> Singles:
    """Pixels of a coarse raster, float32 (v, u, 2)."""
    width, height = camera.size
    return np.stack(np.meshgrid(np.arange(0, width, step), np.arange(0, height, step)), -1).astype(np.float32)


GROUPS = st.integers(0, 2**32 - 1).map(
    lambda seed: np.column_stack(
        [np.random.default_rng(seed).uniform(-1.5, 1.5, (3, 2)), np.random.default_rng(seed).uniform(1.5, 1.9, 3)]
    )
)
"""Three people anywhere in the room."""


def test_colours_forget_the_light_and_share_out_samples() -> None:
    dark, bright = np.array([[[20, 40, 60]]], np.uint8), np.array([[[60, 120, 180]]], np.uint8)
    a, b = normalised(dark)[0, 0].astype(int), normalised(bright)[0, 0].astype(int)
    assert (a[:2] == b[:2]).all() and (a[2], b[2]) == (40, 120)
    assert normalised(np.zeros((1, 1, 3), np.uint8)).tolist() == [[[0, 0, 0]]]
    colour = np.array([[0, 0, 0], [0, 0, 0], [255, 255, 255]], np.uint8)
    shares = histogram(colour)
    assert shares.sum() == pytest.approx(1) and shares[0] == pytest.approx(2 / 3)
    assert bins_of(colour).tolist() == [0, 0, int(np.prod(BINS)) - 1] and histogram(colour[:0]).sum() == 0


@drawn(20, st.integers(0, 2**32 - 1))
def test_density_is_equation_1(seed: int) -> None:
    rng = np.random.default_rng(seed)
    colour = rng.integers(90, 130, (3, 4, 3), np.uint8)
    samples, counts = rng.integers(90, 130, (2, 10, 3), np.uint8), np.array([7, 0])
    wanted = (rng.random((3, 4)) < 0.7).astype(np.uint8)
    density = np.full((2, 3, 4), -1, np.float32)
    fill_density(colour, wanted, np.array([0, 3, 1, 4]), samples, counts, FALL, density)
    for v, u in np.ndindex(3, 4):
        asked = wanted[v, u] and u >= 1
        assert density[0, v, u] == pytest.approx(plain.density(colour[v, u], samples[0, :7]) if asked else -1, rel=1e-4)
        assert density[1, v, u] == (1 if asked else -1)


@drawn(5, GROUPS)
def test_segmentation_is_equations_2_to_4(standing: Floats) -> None:
    ideal, rng = raster(CAMERA), np.random.default_rng(3)
    shape = ideal.shape[:2]
    bodies = bodies_of(CAMERA, standing)
    density = rng.uniform(0.1, 5.0, (3, len(PARTS), *shape)).astype(np.float32)
    foreground = (rng.random(shape) < 0.8).astype(np.uint8)
    canvas = Canvas.of(*shape)
    everywhere = plain.boxes_everywhere(3, shape)
    segment(bodies, np.argsort(bodies[:, 4]), everywhere, ideal, foreground, density, HALF_WIDTH, PARTS, canvas)
    for v, u in zip(*(which.tolist() for which in np.nonzero(foreground)), strict=True):
        pixel = ideal[v, u].astype(float)
        label, share = plain.posterior(
            CAMERA, standing[:, :2], standing[:, 2], pixel, density[:, :, v, u].astype(float)
        )
        assert canvas.label[v, u] == label or share == pytest.approx(0.5, abs=0.05)
        if label >= 0:
            assert canvas.best[v, u] / (canvas.total[v, u] + canvas.free[v, u]) == pytest.approx(share, abs=1e-3)
    assert (canvas.label[foreground == 0] == NO_PERSON).all()


def test_boxes_hold_bodies_and_what_is_open_is_in_front() -> None:
    standing, ideal = people((0.3, -0.4), (-1.2, 1.1)), raster(CAMERA, 2)
    bodies, boxes = bodies_of(CAMERA, standing), np.zeros((2, 4), np.int64)
    fill_boxes(ideal, bodies, np.array([0.0, 0.4]), boxes)
    for k, person in enumerate(standing):
        inside = np.zeros(ideal.shape[:2], bool)
        inside[slice(*boxes[k, :2]), slice(*boxes[k, 2:])] = True
        for pixel in ideal[::4, ::4][~inside[::4, ::4]].astype(float):
            assert plain.covered(*plain.place(CAMERA, person[:2], person[2], pixel)) < 0.01
    far = bodies_of(CAMERA, people((-30.0, -30.0)))
    fill_boxes(ideal, far, np.zeros(1), boxes[:1])
    assert (boxes[0, 1::2] <= boxes[0, ::2]).all()  # behind the camera
    # Two in line with the camera: of the one behind, no pixel that the other covers is open.
    way = -CAMERA.centre[:2] / np.linalg.norm(CAMERA.centre[:2])
    standing = people(tuple(way * -0.4), tuple(way * 0.4))
    ideal = raster(CAMERA, 2)
    bodies, shape = bodies_of(CAMERA, standing), ideal.shape[:2]
    owner, lone = np.full((2, *shape), NO_PERSON, np.int32)
    free = np.zeros(shape, np.float32)
    seen, alone, boxes = np.zeros(2, np.int64), np.zeros(1, np.int64), plain.boxes_everywhere(2, shape)
    fill_unoccluded(bodies, np.array([0, 1]), boxes, ideal, HALF_WIDTH, PARTS, free, owner, seen)
    fill_unoccluded(bodies[1:], np.array([0]), boxes[:1], ideal, HALF_WIDTH, PARTS, free, lone, alone)
    assert seen[1] < 0.6 * alone[0]
    behind = owner // len(PARTS) == 1
    assert behind.sum() < (lone >= 0).sum() and (lone[behind] >= 0).all()


@drawn(50, st.lists(st.floats(-5, 5), min_size=3, max_size=25))
def test_the_middle_of_the_shortest_half_is_the_least_median(distances: list[float]) -> None:
    array = np.array(distances)
    middle = _middle_of_shortest_half(array.copy())
    half = len(distances) // 2
    assert np.sort(np.abs(array - middle))[half] == pytest.approx(plain.median_line(array), abs=1e-9)


@pytest.mark.parametrize("median", [False, True])
def test_the_axis_of_a_whole_body_passes_through_its_place(median: bool) -> None:
    for camera in RIG.cameras:
        standing, ideal = people((0.4, -0.3)), raster(camera, 2)
        bodies, shape = bodies_of(camera, standing), ideal.shape[:2]
        canvas, axes, boxes = Canvas.of(*shape), np.zeros((1, 4)), plain.boxes_everywhere(1, shape)
        foreground = (mask(camera, standing)[::2, ::2] > 127).astype(np.uint8)
        density = np.full((1, len(PARTS), *shape), 20, np.float32)
        segment(bodies, np.array([0]), boxes, ideal, foreground, density, HALF_WIDTH, PARTS, canvas)
        widths = 2 * float(HALF_WIDTH.mean())
        room_ = np.zeros(foreground.size)
        fill_axes(bodies, boxes, ideal, canvas, 2.0, widths, camera.ground, camera.vertical, median, room_, axes)
        feet, _ = camera.project(standing[0, :2], 0.0)
        expected = plain.ground_line(camera, feet)
        assert abs(axes[0, :3] @ np.append(standing[0, :2], 1.0)) < (0.08 if median else 0.04)
        assert abs(abs(axes[0, :2] @ expected[:2]) - 1) < 1e-3 and axes[0, 3] > 0.7


@drawn(30, st.integers(0, 2**32 - 1), st.integers(0, 4))
def test_axes_meet_as_equation_5_says(seed: int, views: int) -> None:
    rng = np.random.default_rng(seed)
    angle = rng.uniform(0, np.pi, (views, 2))
    axes = np.stack([np.cos(angle), np.sin(angle), rng.normal(0, 1, (views, 2)), rng.uniform(0, 1, (views, 2))], -1)
    before = rng.normal(0, 1, (2, 2))
    ground = before.copy()
    farthest = intersect_axes(axes, HYPOTHESIS_WEIGHT, ground)
    for k in range(2):
        np.testing.assert_allclose(ground[k], plain.meeting(axes[:, k], HYPOTHESIS_WEIGHT, before[k]), atol=1e-9)
    assert farthest == pytest.approx(np.hypot(*(ground - before).T).max())


@drawn(6, GROUPS)
def test_misfit_is_equations_6_and_7(standing: Floats) -> None:
    ideal, rng = raster(CAMERA, 8), np.random.default_rng(5)
    shape, bodies = ideal.shape[:2], bodies_of(CAMERA, standing)
    bins = rng.integers(0, int(np.prod(BINS)), shape).astype(np.int32)
    reference = np.stack([[histogram(rng.integers(0, 255, (50, 3), np.uint8)) for _ in PARTS] for _ in standing])
    reference[1, 2] = 0.0
    areas, misfit, counts = np.array([0.06, 0.09, 0.02]) / 64, np.zeros(3), np.zeros(reference.shape[1:])
    add_misfit(
        bodies, np.argsort(bodies[:, 4]), plain.boxes_everywhere(3, shape), ideal, bins, reference, areas, HALF_WIDTH,
        PARTS, np.zeros(shape, np.float32), counts, misfit,
    )  # fmt: skip
    expected = plain.misfit(CAMERA, standing[:, :2], standing[:, 2], ideal, bins, reference, areas, NEUTRAL)
    np.testing.assert_allclose(misfit, expected, atol=1e-6)


def test_particles_are_drawn_and_appearances_are_renewed() -> None:
    rng = np.random.default_rng(2)
    particles = np.arange(8.0).reshape(4, 1, 2)
    weight = particle_weights(np.array([0.0, 0.0, 50.0, 1.0]), 2.0)
    assert weight.sum() == pytest.approx(1) and weight[3] / weight[0] == pytest.approx(np.exp(-2.0))
    drawn = np.concatenate([resampled(particles, weight, rng)[:, 0, 0] for _ in range(500)])
    for place, expected in zip(particles[:, 0, 0], weight, strict=True):
        assert (drawn == place).mean() == pytest.approx(expected, abs=0.01)
    mean, covariance = estimate(particles, weight)
    assert mean[0, 0] == pytest.approx(particles[:, 0, 0] @ weight)
    assert covariance[0, 0, 0] == pytest.approx((particles[:, 0, 0] - mean[0, 0]) ** 2 @ weight)
    rng = np.random.default_rng(0)
    red, blue = np.full((300, 3), (200, 10, 90), np.uint8), np.full((300, 3), (10, 10, 90), np.uint8)
    one = PersonAppearance.unknown().learned(1, red[:10], 0.1, rng)
    assert one.usable_samples.tolist() == [0, 0, 0]  # too few
    assert one.reference.sum() == 0
    full = one.learned(1, red, 0.1, rng)
    assert full.usable_samples.tolist() == [0, SAMPLES, 0] and full.reference[1].max() == 1
    later = full
    for _ in range(5):
        later = later.learned(1, blue, 0.1, rng)
    share = (later.samples[1, :, 0] == 10).mean()
    assert 0.2 < share < 0.6
    assert full.samples[1, 0, 0] == 200  # nothing is changed in place


def passing(config: Config, frames: int) -> Rows:
    """Rows of two who pass each other; the pass finds them in the first four frames alone."""
    tracker = ParticleTracker(RIG, config, 0)
    commits = follow(tracker, frames, ((-1.2, -0.3, 0.1, 0.0), (1.2, 0.3, -0.1, 0.0)), found_until=4)
    return rows_of(commits + tracker.finish())


QUICK = replace(CONFIG, particles=ParticleConfig(particles=6, raster_columns=64, patience=10.0))
FRAMES = 16 if COMPILED else 6


@compiled_only
def test_people_are_followed_by_their_colours_until_they_go() -> None:
    rows = passing(QUICK, FRAMES)
    assert np.unique(rows["id"]).tolist() == [1, 2] and len(rows) == 2 * FRAMES
    x = np.where(rows["id"] == 1, -1.2 + 0.1 * rows["frame"], 1.2 - 0.1 * rows["frame"])
    off = np.hypot(rows["x"] - x, rows["y"] - np.where(rows["id"] == 1, -0.3, 0.3))
    assert off.mean() < 0.1 and off.max() < 0.35
    assert (rows["xx"] > 0).all()
    config = replace(QUICK, particles=replace(QUICK.particles, patience=0.5))
    tracker = ParticleTracker(RIG, config, 0)
    commits = follow(tracker, 7, [(0.0, 0.0, 0.0, 0.0)], found_until=2)
    events = np.concatenate([commit.events for commit in commits])[["frame", "kind", "reason"]].tolist()
    assert events == [(0, b"birth", b"found where nobody was followed"), (6, b"death", b"not found for 0.5 s")]


def test_the_search_goes_to_the_person_from_beside() -> None:
    standing = people((0.2, 0.1))
    views = [ParticleView(camera, 64) for camera in RIG.cameras]
    colour = colour_views(observations_of(standing), "particles", 0)
    rng, appearance = np.random.default_rng(0), PersonAppearance.unknown()
    shirt = normalised(np.array([[SHIRTS[0]]], np.uint8)).reshape(1, 3).repeat(SAMPLES, 0)
    for part in range(len(PARTS)):
        appearance = appearance.learned(part, shirt, 0.0, rng)
    beside = standing[:, :2] + np.array([[0.25, -0.15]])
    frames = [
        view.prepare(seen, beside, standing[:, 2], [appearance], np.array([0.6]))
        for view, seen in zip(views, colour, strict=True)
        if seen is not None
    ]
    for median in (False, True):
        reached = search(frames, beside, 5, median)
        assert np.hypot(*(reached - standing[:, :2]).T).max() < 0.06
    wrong, right = np.zeros(1), np.zeros(1)
    for frame in frames:
        frame.add_misfit(beside, appearance.reference[None], wrong)
        frame.add_misfit(standing[:, :2], appearance.reference[None], right)
    assert right[0] < wrong[0]


def test_who_was_lost_is_known_again_where_somebody_is_found() -> None:
    """The particles are a metre off; the pass finds somebody in the old clothes where nobody is followed."""
    standing, tracker = people((-0.5, 0.2)), ParticleTracker(RIG, QUICK, 0)
    follow(tracker, 3, [(-0.5, 0.2, 0.0, 0.0)])
    away, crowd = np.array([1.0, 0.2]), tracker.crowd
    tracker.crowd = replace(crowd, ground=crowd.ground + away, particles=crowd.particles + away)
    (commit,) = tracker.add(frame_of(3, standing), observations_of(standing))
    assert commit.trajectory["id"].tolist() == [1]
    assert np.hypot(commit.trajectory["x"] + 0.5, commit.trajectory["y"] - 0.2)[0] < 0.15
    assert len(commit.events) == 0


def test_one_colour_camera_or_a_lens_is_enough() -> None:
    standing = people((0.0, 0.0))
    full = observations_of(standing)
    tracker = ParticleTracker(RIG, QUICK, 0)
    alone = FrameObservations(
        [full.observations[0], mask(RIG.cameras[1], standing), None, None],
        [full.evidence[0], full.evidence[1], None, None],
    )
    blind = FrameObservations([None] * 4, [None] * 4)
    rows = rows_of([*tracker.add(frame_of(0, standing), alone), *tracker.add(frame_of(1, standing), blind)])
    assert rows["id"].tolist() == [1, 1]
    assert [view is not None for view in colour_views(alone, "particles", 0)] == [True, False, False, False]
    # The same person through a barrel lens: the axis still passes through their place.
    camera = looking("barrel", (-3.5, -3.5, 2.6), distortion=(-0.2, 0.03, 0.0, 0.0, 0.0))
    view, standing = ParticleView(camera, SIZE[0]), people((0.6, 0.4))
    silhouette = (mask(camera, standing) / np.float32(255)).astype(np.float32)
    seen = colour_views(FrameObservations([painted(camera, standing)], [silhouette]), "particles", 0)[0]
    assert seen is not None
    frame = view.prepare(seen, standing[:, :2], standing[:, 2], [PersonAppearance.unknown()], np.array([0.3]))
    axes = np.zeros((1, 4))
    frame.fill_axes(standing[:, :2], True, axes)
    assert abs(axes[0, :3] @ np.append(standing[0, :2], 1.0)) < 0.05 and axes[0, 3] > 0.5
