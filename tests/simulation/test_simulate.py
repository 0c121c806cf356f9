"""The simulated scenes: geometry, bodies, crowd, light, detector, files and the command."""

import os
from collections import Counter
from dataclasses import fields, replace
from itertools import islice
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from checks import Captured, cases, compiled_only, drawn, numbers, refused
from hypothesis import strategies as st
from reference_simulate import extents, hits, shade
from scipy.spatial.distance import pdist
from strategies import BARREL, cameras

from stseg import Camera, read_recording, read_tracks_csv
from stseg.arrays import Floats
from stseg.commands.simulate import simulate
from stseg.errors import ConfigError, OutputError
from stseg.io.outputs.simulated_scene import write_scene
from stseg.io.recording.frames import open_frames, read_background
from stseg.simulation import NAMED, Lamp, SceneFilm, SceneSpec
from stseg.simulation.crowd.social_forces import CrowdFrame, walk_freely
from stseg.simulation.rendering import ray_casting as draw_module
from stseg.simulation.rendering.body import PARTS, pose, upright_cylinders
from stseg.simulation.rendering.cameras import build_rig, pixel_rays
from stseg.simulation.rendering.clothes import clothing, own_clothing
from stseg.simulation.rendering.ray_casting import PENUMBRA, darken, draw_bodies, pixel_boxes
from stseg.simulation.rendering.render import LAMP, Viewer
from stseg.simulation.scene import KINDS
from stseg.simulation.spoiling.detector import detect, visible_boxes

TINY = NAMED["tiny"]
NOISELESS = replace(TINY, noise=0.0, light_drift=0.0, shadows=0.0)


def crowd_of(ground: Floats, phase: float = 0.7, swing: float = 1.0, heading: float = 0.4) -> CrowdFrame:
    """People of many sizes at given places."""
    n, ones = len(ground), np.ones(len(ground))
    heights = np.linspace(1.55, 1.9, n)
    return CrowdFrame(0, np.arange(1, n + 1), ground, heading * ones, phase * ones, swing * ones, heights, ones)


def viewers(spec: SceneSpec) -> list[Viewer]:
    return SceneFilm(spec).viewers


@cases()
def test_scene_refuses_what_cannot_be(key: str, value: object) -> None:
    refused(ConfigError, f"scene tiny: {key}", replace, TINY, **{key: value})


@pytest.mark.parametrize("name", NAMED)
def test_cameras_stand_where_the_scene_says_and_see_the_area(name: str) -> None:
    spec = NAMED[name]
    rig = build_rig(spec)
    rig.require_coverage()
    assert len(rig.cameras) == spec.cameras
    for camera in rig.cameras:
        assert np.hypot(*camera.centre[:2]) == pytest.approx(spec.camera_distance, rel=0.06)
        assert camera.centre[2] == pytest.approx(spec.camera_height, rel=0.07)
        pixel, ahead = camera.project(rig.grid.ground, 1.0)
        assert np.mean(ahead & camera.inside(pixel)) > 0.9


def test_half_the_cameras_are_of_the_whole_and_places_too() -> None:
    few, many = build_rig(NAMED["dense4"]).cameras, build_rig(NAMED["dense"]).cameras
    for camera, twin in zip(few, many[::2], strict=True):
        np.testing.assert_array_equal(camera.projection, twin.projection)
    spec = replace(TINY, cameras=4, people=1)
    whole, half = (next(SceneFilm(s).frame_sets()) for s in (spec, replace(spec, cameras=2)))
    np.testing.assert_array_equal(whole.views[2].image, half.views[1].image)
    spec = replace(TINY, cameras=1, noise=9.0, size=(32, 24))
    for one, other in zip(walk_freely(TINY), walk_freely(spec), strict=True):
        for field in fields(CrowdFrame):
            np.testing.assert_array_equal(getattr(one, field.name), getattr(other, field.name))


@drawn(15, camera=cameras(size=(80, 60)), depth=st.floats(0.5, 20.0))
def test_rays_go_through_the_points_that_their_pixels_show(camera: Camera, depth: float) -> None:
    rays = pixel_rays(camera)
    visible = np.any(rays != 0, axis=-1)
    point = camera.centre + depth * rays[visible]
    pixel, ahead = camera.project(point[:, :2], point[:, 2])
    v, u = np.nonzero(visible)
    assert ahead.all()
    np.testing.assert_allclose(pixel, np.stack([u, v], -1), atol=2e-2)
    depths = np.concatenate([point, np.ones((len(point), 1))], 1) @ camera.projection[2]
    np.testing.assert_allclose(depths / np.linalg.norm(camera.projection[2, :3]), depth, rtol=1e-4)


@pytest.mark.parametrize("phase", [0.0, 0.8, 1.6, 2.7, 4.4])
@pytest.mark.parametrize("swing", [0.0, 0.5, 1.0])
def test_bodies_stand_on_the_ground_as_tall_as_they_are(phase: float, swing: float) -> None:
    bodies = pose(crowd_of(np.array([[0.3, -0.2], [1.0, 0.5]]), phase, swing))
    reach = np.linalg.norm(bodies.axes[..., 2], axis=-1)  # of an ellipsoid along the vertical
    low, high = (bodies.centre[..., 2] - reach).min(axis=1), (bodies.centre[..., 2] + reach).max(axis=1)
    np.testing.assert_allclose(low, 0.0, atol=0.03)
    drop = 0.08 if swing else 0.005  # legs apart make a body lower
    assert (np.abs(high - [1.55, 1.9]) < drop).all()


def test_limbs_swing_and_clothes_are_of_people_in_own_tones() -> None:
    viewer = viewers(replace(TINY, size=(160, 120)))[0]
    here = np.array([[0.0, 0.0]])
    masks = {
        (phase, swing): viewer.draw(crowd := crowd_of(here, phase, swing), pose(crowd)).instances > 0
        for phase in (0.0, np.pi / 2, np.pi, 2 * np.pi)
        for swing in (0.0, 1.0)
    }
    body = masks[0.0, 1.0].sum()
    assert (masks[0.0, 1.0] ^ masks[np.pi / 2, 1.0]).sum() > 0.15 * body
    assert (masks[0.0, 1.0] ^ masks[2 * np.pi, 1.0]).sum() <= 1
    assert (masks[0.0, 0.0] ^ masks[np.pi / 2, 0.0]).sum() == 0
    np.testing.assert_array_equal(own_clothing(5, 3), own_clothing.__wrapped__(5, 3))
    assert not np.array_equal(own_clothing(5, 3), own_clothing(5, 4))
    assert not np.array_equal(own_clothing(5, 3), own_clothing(6, 3))
    assert own_clothing(5, 3).shape[0] == len(PARTS)
    dressed = [clothing(5, person, 3) for person in (1, 2, 3, 4)]
    clothes = [own_clothing(5, person) for person in (1, 2, 3, 4)]
    np.testing.assert_array_equal(dressed[0], clothes[0])
    np.testing.assert_array_equal(dressed[3], clothes[3])
    for k in (1, 2):
        np.testing.assert_allclose((dressed[k] - clothes[0])[:, :6], 0.2 * (clothes[k] - clothes[0])[:, :6])
        np.testing.assert_array_equal(dressed[k][:, 6:], clothes[0][:, 6:])


@drawn(
    8,
    ground=st.lists(st.tuples(numbers(-1.6, 1.6), numbers(-1.6, 1.6)), min_size=1, max_size=3),
    phase=st.floats(0.0, 6.2),
    distortion=st.sampled_from(((), (-0.22, 0.05, 0.001, -0.001), BARREL)),
)
def test_rays_meet_what_stands(ground: list[tuple[float, float]], phase: float, distortion: tuple[float, ...]) -> None:
    viewer = viewers(replace(NOISELESS, size=(48, 36), cameras=1, distortion=distortion))[0]
    crowd = crowd_of(np.array(ground), phase)
    bodies = pose(crowd)
    drawing = viewer.draw(crowd, bodies)
    depth = hits(pixel_rays(viewer.camera), viewer.camera.centre, bodies)
    nearest = np.where(np.isfinite(depth.min(axis=0)), crowd.id[depth.argmin(axis=0)], 0)
    np.testing.assert_array_equal(drawing.instances, nearest)
    np.testing.assert_array_equal(drawing.silhouettes, extents(np.isfinite(depth)))


@compiled_only
def test_shadows_fall_away_from_the_lamp() -> None:
    viewer = viewers(replace(TINY, size=(48, 36)))[0]
    bodies = pose(crowd_of(np.array([[0.2, -0.3], [-0.9, 0.4]])))
    corners = bodies.corners(PENUMBRA)
    boxes = pixel_boxes(viewer.camera, corners - corners[..., 2:] / LAMP[2] * LAMP).reshape(-1, 4)
    dark = np.zeros(viewer.room.image.shape[:2], np.float32)
    darken(viewer.room.ground, boxes, bodies.centre.reshape(-1, 3), bodies.form.reshape(-1, 3, 3), LAMP, dark)
    expected = shade(viewer.room.ground, bodies, LAMP, 0.75, PENUMBRA)
    np.testing.assert_allclose(dark, expected, atol=0.03)
    assert 0.005 < (dark > 0.5).mean() < 0.2


def test_shadows_darken_the_ground_and_nothing_else() -> None:
    crowd = crowd_of(np.array([[0.0, 0.0]]))
    for strength in (0.0, 0.5):
        viewer = viewers(replace(TINY, shadows=strength))[0]
        drawing = viewer.draw(crowd, pose(crowd))
        ground = drawing.instances == 0
        before, after = viewer.room.image[ground].astype(float), drawing.light[ground].astype(float)
        assert (after <= before).all()
        assert (after / np.maximum(before, 1)).min() == pytest.approx(1 - strength, abs=0.02)


def test_animals_have_their_length_in_the_direction_they_face() -> None:
    crowd = crowd_of(np.zeros((1, 2)), heading=0.4)
    bodies = upright_cylinders(crowd, 0.35, 1.1)
    ahead, across = np.array([np.cos(0.4), np.sin(0.4), 0.0]), np.array([-np.sin(0.4), np.cos(0.4), 0.0])
    for direction, half in ((ahead, 0.55), (across, 0.175)):
        reach = np.sqrt(((bodies.axes[0] @ direction) ** 2).sum(-1))
        assert reach.max() == pytest.approx(half)


def as_it_is(kernel: Any) -> Any:
    return kernel


def python_form(kernel: Any) -> Any:
    return getattr(kernel, "py_func", kernel)


def test_compiled_and_plain_kernels_agree(monkeypatch: pytest.MonkeyPatch) -> None:
    viewer = viewers(replace(TINY, size=(24, 18)))[0]
    crowd = crowd_of(np.array([[0.2, -0.3], [0.4, 0.1]]))
    bodies, camera = pose(crowd), viewer.camera
    paint = np.array([own_clothing(1, int(person)) for person in crowd.id])
    boxes, results = pixel_boxes(camera, bodies.corners(1.0)), []
    for form in (as_it_is, python_form):
        for name in ("_nearest", "_paint"):
            monkeypatch.setattr(draw_module, name, form(getattr(draw_module, name)))
        depth, image = np.full((18, 24), np.inf, np.float32), viewer.room.image.copy()
        instances, silhouettes = np.zeros((18, 24), np.uint16), np.empty((2, 5), np.int64)
        scene = (pixel_rays(camera), camera.centre, boxes, bodies.centre, bodies.form, paint, LAMP)
        form(draw_bodies)(*scene, crowd.id.astype(np.uint16), depth, image, instances, silhouettes)
        dark = np.zeros((18, 24), np.float32)
        parts = bodies.centre.reshape(-1, 3), bodies.form.reshape(-1, 3, 3)
        whole = np.tile(np.array([0, 23, 0, 17]), (len(parts[0]), 1))
        with np.errstate(invalid="ignore"):
            form(darken)(viewer.room.ground, whole, *parts, LAMP, dark)
        visible = np.empty((2, 5), np.int64)
        form(visible_boxes)(instances, np.array([0, 0, 1]), visible)
        results.append((depth, image.astype(int), instances, silhouettes, dark, visible))
    for compiled, plain in zip(*results, strict=True):
        np.testing.assert_allclose(compiled, plain, rtol=1e-5, atol=1.001 if compiled is results[0][1] else 1e-5)


@pytest.mark.parametrize("name", ["easy", "dense", "demo"])
def test_crowds_keep_apart_come_and_go(name: str) -> None:
    spec = NAMED[name]
    inside, earlier, gone = list[int](), set[int](), set[int]()
    last: dict[int, tuple[Floats, float]] = {}
    for frame, crowd in enumerate(walk_freely(spec)):
        assert crowd.frame == frame and pdist(crowd.ground).min(initial=np.inf) > 0.35
        truth = crowd.truth(spec.area)
        assert (np.abs(truth["x"]) <= spec.area[0] / 2).all() and (np.abs(truth["y"]) <= spec.area[1] / 2).all()
        inside.append(len(truth))
        present = set(crowd.id.tolist())
        assert not present & gone, "no person comes back"
        gone |= earlier - present
        earlier |= present
        for person, ground, phase in zip(crowd.id.tolist(), crowd.ground, crowd.phase, strict=True):
            if person in last:
                way, turn = np.hypot(*(ground - last[person][0])), phase - last[person][1]
                assert way * spec.frame_rate < 2.5
                # Two steps are 0.35 to 0.76 of the height.
                assert way / (0.77 * 1.98) - 1e-9 <= turn / (2 * np.pi) <= 1.2 * (way + 0.05) / (0.34 * 1.45)
            last[person] = ground, phase
    assert len(inside) == spec.frames and max(inside) <= spec.people + 1
    assert 0.8 * spec.people < np.mean(inside) and len(earlier) > spec.people


@compiled_only
def test_regulars_come_back_and_nobody_leaves_closed_rooms() -> None:
    spec = replace(NAMED["return"], seconds=NAMED["return"].seconds / 2)
    came, heights, before = Counter[int](), set[tuple[int, float]](), set[int]()
    for crowd in walk_freely(spec):
        heights.update(zip(crowd.id.tolist(), crowd.height.tolist(), strict=True))
        came.update(set(crowd.id.tolist()) - before)
        before = set(crowd.id.tolist())
    assert set(came) == set(range(1, spec.people + 1)) and min(came.values()) >= 3
    assert len(heights) == spec.people
    spec = replace(NAMED["long"], seconds=120.0)
    assert all(len(crowd.truth(spec.area)) == spec.people for crowd in walk_freely(spec))


def test_equal_scenes_are_equal_and_seeds_matter() -> None:
    first, again, other = (
        list(islice(SceneFilm(spec).frame_sets(), 2)) for spec in (TINY, TINY, replace(TINY, seed=5))
    )
    for moment, twin, stranger in zip(first, again, other, strict=True):
        np.testing.assert_array_equal(moment.truth, twin.truth)
        for view, same, else_view in zip(moment.views, twin.views, stranger.views, strict=True):
            np.testing.assert_array_equal(view.image, same.image)
            np.testing.assert_array_equal(view.instances, same.instances)
            np.testing.assert_array_equal(view.boxes.pixel, same.boxes.pixel)
            assert not np.array_equal(view.image, else_view.image)


def test_empty_frames_noise_and_light_are_as_asked_for() -> None:
    film = SceneFilm(NOISELESS)
    empty = next(film.empty())
    moment = next(film.frame_sets())
    for image, view in zip(empty, moment.views, strict=True):
        close = cv2.dilate((view.instances > 0).astype(np.uint8), np.ones((5, 5), np.uint8)) > 0  # the lens is soft
        np.testing.assert_array_equal(view.image[~close], image[~close])
        assert (view.image[view.instances > 0] != image[view.instances > 0]).mean() > 0.5
    noise = images(noise=6.0)[0] - images()[0]
    assert np.std(noise) == pytest.approx(6.0, rel=0.05) and abs(np.mean(noise)) < 0.3
    means = images(light_drift=0.2, light_period=1.0).mean((2, 3, 4))
    swing = (means.max(axis=0) - means.min(axis=0)) / means.mean(axis=0) / 2
    np.testing.assert_allclose(swing, 0.2, atol=0.02)


def images(**settings: object) -> Floats:
    """Images of the empty scene without noise, but for these settings; float64 (frame, view, v, u, channel)."""
    spec = replace(NOISELESS, people=0, **settings)  # type: ignore[arg-type]
    return np.array([[view.image for view in frame.views] for frame in SceneFilm(spec).frame_sets()], float)


def test_lamps_and_clouds_light_what_is_near_and_people() -> None:
    lit = images(lamps=(Lamp(1.5, on=0.3, off=0.6, place=(0.0, 0.0, 1.0), reach=1.0),))[:, 0]
    far = np.hypot(*np.nan_to_num(viewers(NOISELESS)[0].room.ground, nan=99.0).transpose(2, 0, 1))
    for frame in (2, 6, 9):
        np.testing.assert_array_equal(lit[frame], lit[0])
    gain = lit[3] / np.maximum(lit[0], 1)
    assert np.median(gain[far < 0.5]) == pytest.approx(1.72, abs=0.05)  # half of 1.5 a metre below it
    assert gain[far < 0.5].min() > 1.5 > 1.15 > np.median(gain[(far > 2.5) & (far < 99)])
    means = images(lamps=(Lamp(-0.5, on=0.2, rise=0.4),))[:, 1].mean((1, 2, 3))
    np.testing.assert_allclose(means[[0, 2, 4, 6, 9]] / means[0], [1, 1, 0.75, 0.5, 0.5], atol=0.02)
    spec = replace(NOISELESS, seconds=0.1, size=(160, 120))
    lamp = replace(spec, lamps=(Lamp(0.4, on=0.0, place=(0.0, 0.0, 2.0), reach=2.0),))
    dark, bright = (next(SceneFilm(one).frame_sets()).views[0] for one in (spec, lamp))
    person = np.asarray(dark.instances > 0)
    assert person.any()
    np.testing.assert_array_equal(dark.instances, bright.instances)
    gain = bright.image[person].astype(float).sum() / dark.image[person].sum()
    assert 1.1 < gain < 1.4


@pytest.mark.parametrize(("key", "value"), [("brightness", -1.0), ("off", -2.0), ("rise", -1.0), ("reach", 0.0)])
def test_lamps_that_cannot_be_are_refused(key: str, value: float) -> None:
    refused(ConfigError, key, Lamp, **{"brightness": 1.0, "on": 0.0, key: value})  # type: ignore[arg-type]


CAMERA = build_rig(replace(TINY, size=(320, 240))).cameras[0]


def _detections(share: float, rounds: int) -> tuple[int, list[Floats]]:
    """Number of frames out of `rounds` with a box of a person with a visible share, and those boxes."""
    whole = np.array([[100, 139, 80, 179, 2400]])
    visible = np.array([[100, 139, 80, 80 + round(99 * share), round(2400 * share)]])
    found = []
    for k in range(rounds):
        boxes = detect(CAMERA, visible, whole, np.array([1.5, 1.5]), np.random.default_rng(k))
        assert ((boxes.score >= 0) & (boxes.score <= 1)).all() and (boxes.pixel[:, 2:] > 0).all()
        close = np.abs(boxes.pixel[:, :2] - [99.5, 79.5]).max(axis=1) < 15
        found += list(boxes.pixel[close][:1])
    return len(found), found


def test_detectors_miss_shake_guess_and_see_ghosts() -> None:
    full, boxes = _detections(1.0, 300)
    half, little = (_detections(share, 300)[0] for share in (0.4, 0.1))
    assert full > 0.93 * 300 > half > 0.3 * 300 > little and little < 0.1 * 300
    np.testing.assert_allclose(np.mean(boxes, axis=0), [99.5, 79.5, 40, 100], atol=0.8)
    assert 1.0 < np.std(boxes, axis=0)[3] < 8.0
    _, boxes = _detections(0.6, 200)
    tall = np.array(boxes)[:, 3] > 80
    assert 0.3 < tall.mean() < 0.9
    nobody, focus = np.zeros((0, 5), np.int64), np.array([1.5, 1.5])
    counts = [len(detect(CAMERA, nobody, nobody, focus, np.random.default_rng(k))) for k in range(400)]
    assert 0.02 < np.mean(counts) < 0.2


def test_a_written_scene_reads_back(tmp_path: Path) -> None:
    spec = replace(TINY, seconds=0.4, quality=95)
    film, reported = SceneFilm(spec), []
    write_scene(tmp_path / "a", film, instances=True, frame_done=lambda: reported.append(1))
    assert len(reported) == 4
    moments = list(film.frame_sets())
    names = ("rig", "rig_masks", "rig_boxes", "rig_instances")
    recordings = [read_recording(tmp_path / "a" / f"{name}.toml") for name in names]
    readers = [open_frames(recording) for recording in recordings]
    for moment, *read in zip(moments, *readers, strict=True):
        for k, view in enumerate(moment.views):
            image, mask, boxes, instances = (one.views[k] for one in read)
            assert isinstance(image, np.ndarray) and np.abs(image.astype(int) - view.image).mean() < 4
            np.testing.assert_array_equal(mask, np.where(view.instances > 0, 255, 0))
            np.testing.assert_array_equal(instances, view.instances)
            np.testing.assert_allclose(boxes.pixel, view.boxes.pixel, atol=0.051)
    for reader in readers:
        reader.close()
    assert len(list(read_background(recordings[0], 0))) == 40
    truth = np.concatenate([moment.truth for moment in moments])
    table = read_tracks_csv(tmp_path / "a" / "truth.csv")
    for name in ("frame", "id", "x", "y"):
        np.testing.assert_allclose(table[name], truth[name], atol=5.1e-5)


def test_a_full_folder_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    film = SceneFilm(replace(TINY, seconds=0.1))
    refused(OutputError, "files in it", write_scene, tmp_path, film)
    assert [file.name for file in tmp_path.iterdir()] == ["notes.txt"]
    write_scene(tmp_path, film, overwrite=True)
    assert (tmp_path / "notes.txt").read_text() == "mine"
    (tmp_path / "link").symlink_to(tmp_path)
    refused(OutputError, "found link, a link", write_scene, tmp_path, film, overwrite=True)
    (tmp_path / "link").unlink()
    refused(OutputError, "no UTF-8", write_scene, tmp_path / os.fsdecode(b"\xff"), film)
    (tmp_path / "stseg-scene").unlink()
    refused(OutputError, r"truth\.csv: found a file that stseg did not", write_scene, tmp_path, film, overwrite=True)
    refused(OutputError, "notes.txt", write_scene, tmp_path / "notes.txt" / "below", film)


def test_command_changes_the_named_scene(tmp_path: Path, capsys: Captured) -> None:
    simulate(tmp_path / "s", scene="tiny", cameras=1, seconds=0.2, size="40,32", noise=0.0, people=1)
    recording = read_recording(tmp_path / "s" / "rig.toml")
    assert [camera.size for camera in recording.rig.cameras] == [(40, 32)]
    assert read_tracks_csv(tmp_path / "s" / "truth.csv")["frame"].max() == 1
    assert "2 frames of 1 camera;" in capsys.readouterr().out


@compiled_only
def test_a_scene_of_boxes_has_nothing_else(tmp_path: Path, capsys: Captured) -> None:
    simulate(tmp_path / "s", scene="long", cameras=2, seconds=0.4, size="64,48")
    assert {path.name for path in (tmp_path / "s").iterdir()} == {
        "stseg-scene", "rig_boxes.toml", "truth.csv", "cam1_boxes.csv", "cam2_boxes.csv",
    }  # fmt: skip
    assert "rig_boxes.toml: 2 frames" in capsys.readouterr().out
    spec = replace(NAMED["long"], seconds=0.4, cameras=2)
    alone, all_kinds = (SceneFilm(one).frame_sets() for one in (spec, replace(spec, kinds=KINDS)))
    for one, other in zip(alone, all_kinds, strict=True):
        for view, whole in zip(one.views, other.views, strict=True):
            np.testing.assert_array_equal(view.boxes.pixel, whole.boxes.pixel)


def test_the_command_suggests_scenes_and_says_animals(tmp_path: Path) -> None:
    refused(ConfigError, "did you mean dense", simulate, tmp_path, scene="dence")
    refused(ConfigError, "--size", simulate, tmp_path, scene="tiny", size="40x30")
    simulate(tmp_path / "a", scene="animals", seconds=0.06, size="64,48")
    simulate(tmp_path / "b", scene="tiny", seconds=0.1)
    body = read_recording(tmp_path / "a" / "rig_masks.toml").body
    assert (body.height_mean, body.width_mean) == (0.6, 0.725)
    assert read_recording(tmp_path / "b" / "rig.toml").body.height_mean is None
