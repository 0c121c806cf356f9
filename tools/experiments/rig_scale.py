"""How well automatic rigs know their scale: stated and true errors with none, one and three distances.

    python tools/experiment.py rig_scale

Five rigs are of `uu4_colour`: all four views, and three of them. The others are of simulated rooms, whose masks are
cropped, wider or narrower by view, some with shadows; rooms from 18 on are held apart. Scales are of the floor, and of
people's places. `uu4` lends its lenses; the board on its floor places its cameras: by their own places they miss it by
a pixel, and ground 4 m away by 0.1 to 0.3 m.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import chain

import cv2
import numpy as np
from result_sets import SETS
from workbench import Bench, command_line, write_table

from stseg.arrays import Flags, Floats, Ints
from stseg.calibration.adjusted_rig import cameras_of
from stseg.calibration.automatic.auto import calibrate_from_people
from stseg.calibration.automatic.endpoints import concatenate_endpoints, upright_endpoints
from stseg.calibration.automatic.scale import KnownDistance, adjusted_to, scale_spread
from stseg.calibration.automatic.solution import CalibrationInput
from stseg.calibration.points.camera_models import Points
from stseg.calibration.points.point_fit import fit_points
from stseg.engine.reporter import reporter_of
from stseg.errors import SourceError
from stseg.geometry import Camera, Lens, Rig
from stseg.io.recording.rigs import read_recording
from stseg.io.track_csv import read_tracks_csv
from stseg.simulation import SceneFilm, SceneSpec, Spoil
from stseg.tasks.calibration.automatic import people_of

_ROOMS, _PLACES, _LEAST_METRES, _MARGIN, _SQUARE, _MIDDLE = 22, 400, 1.5, 0.1, 0.115, 0.9
"""Rooms; places; least distance, metres; least way to the border, image widths; a square's side; height of middles."""


def shown(camera: Camera, ground: Floats) -> tuple[Floats, Flags]:
    """Pixels of places (n, 2), and whether each lies in the image, by a tenth of its width from the border."""
    pixel, margin = camera.project(ground, 0.0)[0].round(1), _MARGIN * camera.size[0]
    return pixel, np.all((pixel > margin) & (pixel < np.array(camera.size) - margin), axis=-1)


def distances(rig: Rig, ground: Floats) -> Iterator[KnownDistance]:
    """Distances between places (n, 2), each in one camera that shows both, camera by camera in turns."""
    for k, ends in enumerate(ground.reshape(-1, 2, 2)):
        view, metres = k % len(rig.cameras), float(np.linalg.norm(ends[1] - ends[0]))
        pixel, is_shown = shown(rig.cameras[view], ends)
        if metres >= _LEAST_METRES and is_shown.all():
            yield KnownDistance(view, pixel, metres)


def scales(made: tuple[Camera, ...], rig: Rig, ground: Floats) -> Iterator[float]:
    """Scale of the floor as each made camera sees it, and of where the rays of all to the middles of bodies meet."""
    views = [(camera, true, *shown(true, ground)) for true, camera in zip(rig.cameras, made, strict=True)]
    seen = np.concatenate([camera.back_project(pixel[is_shown]) for camera, _, pixel, is_shown in views])
    normal, moment = np.zeros((len(ground), 3, 3)), np.zeros((len(ground), 3))
    for camera, true, _, is_shown in views:
        ray = camera.rays(true.project(ground, _MIDDLE)[0])
        across = np.eye(3) - ray[:, :, None] * ray[:, None] / (ray**2).sum(axis=1)[:, None, None]
        across[~(is_shown & np.isfinite(ray).all(axis=1))] = 0
        normal, moment = normal + across, moment + across @ camera.centre
    met = np.linalg.matrix_rank(normal, 1e-3) == 3
    meeting = np.linalg.solve(normal[met], moment[met][..., None])[:, :2, 0]
    for place, found in ((np.concatenate([ground[one[3]] for one in views]), seen), (ground[met], meeting)):
        a, b = (points[np.isfinite(found).all(axis=1)] @ [1, 1j] for points in (place, found))
        yield float(abs(np.vdot(a - a.mean(), b - b.mean())) / (a.var() * len(a)))


def on_board(bench: Bench, camera: Camera) -> Camera:
    """A camera of `uu4`, placed by the board on the floor."""
    image = cv2.VideoCapture(str(bench.path(f"$DATA/uu4/{camera.name}/extrinsics.avi"))).read()[1]
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    _, corners = cv2.findChessboardCorners(grey, (8, 6))
    corner = cv2.cornerSubPix(grey, corners, (4, 4), (-1, -1), (3, 30, 0.01)).reshape(-1, 2).astype(float)
    ground = _SQUARE * (camera.back_project(corner) / _SQUARE).round()
    return fit_points(camera.name, camera.size, Points(corner, ground, np.zeros(len(ground))), camera.lens).camera


Seen = tuple[str, Rig, Floats, CalibrationInput]
"""Name, true rig, places of people, what views show of them."""


def real(bench: Bench) -> Iterator[Seen]:
    """The real recording, by all views and by three."""
    bench.do(SETS["uu4_colour"].prepare[0])
    recording = read_recording(bench.path("$WORK/uu4_colour.toml"))
    rows = read_tracks_csv(bench.path("$DATA/uu4/reference_tracks.csv"))
    people = people_of(recording, None, 1.7, 2.0, reporter_of(None))[0]
    cameras = [on_board(bench, camera) for camera in recording.rig.cameras]
    for left_out in (None, *range(len(cameras))):
        views = [k for k in range(len(cameras)) if k != left_out]
        rig = replace(recording.rig, cameras=tuple(cameras[k] for k in views))
        seen = replace(people, endpoints=tuple(people.endpoints[k] for k in views), sizes=people.sizes[: len(views)])
        name = "uu4_colour" + ("" if left_out is None else f" without {cameras[left_out].name}")
        yield name, rig, np.column_stack([rows["x"], rows["y"]]), seen


def room(number: int) -> Seen:
    """A simulated room: people, cameras and errors of masks are drawn."""
    lots = np.random.default_rng(number)
    side, tall, k1 = lots.uniform(4.5, 6.5), 1.7 + 0.067 * np.clip(lots.normal(), -2, 2), lots.uniform(-0.36, 0.0)
    people, views, width = (int(lots.integers(*bounds)) for bounds in ((1, 5), (3, 6), (480, 641)))
    spec = SceneSpec(
        f"room {number}",
        people,
        (side, side),
        36.0,
        5.0,
        views,
        camera_distance=0.72 * side + lots.uniform(0.3, 1.5),
        camera_height=lots.uniform(2.0, 3.8),
        field_of_view=lots.uniform(55.0, 85.0),
        size=(width, 3 * width // 4),
        distortion=(k1, -k1 * lots.uniform(0.0, 0.2)),
        heights=(tall - 0.12, tall + 0.12),
        kinds=("masks",),
        seed=number,
    )
    film, wider = SceneFilm(spec, [Spoil("shadows", 0.05)] * (number % 3 == 0)), lots.integers(-2, 3, views)
    corner, size = lots.integers(0, width // 20, (views, 2)), (width - width // 20, 3 * width // 4 - width // 20)
    ends, places = [list[tuple[int, Floats]]() for _ in wider], list[Floats]()
    for frame in film.frame_sets():
        places.append(np.column_stack([frame.truth["x"], frame.truth["y"]]))
        for view, by, (u, v), found in zip(frame.views, wider, corner, ends, strict=True):
            mask = (cv2.dilate if by > 0 else cv2.erode)(view.mask, np.ones((2 * abs(by) + 1,) * 2, np.uint8))
            found.append((frame.frame, upright_endpoints(mask[v : v + size[1], u : u + size[0]] / np.float32(255))))
    rig = replace(film.rig, cameras=tuple(cropped(*one, size) for one in zip(film.rig.cameras, corner, strict=True)))
    seen = CalibrationInput(tuple(map(concatenate_endpoints, ends)), (size,) * views, 5.0, 1.7, 2.0)
    return spec.name, rig, np.concatenate(places), seen


def cropped(camera: Camera, corner: Ints, size: tuple[int, int]) -> Camera:
    """A camera of a part of its image, from a corner on."""
    assert camera.lens is not None
    move = np.array([[1, 0, -corner[0]], [0, 1, -corner[1]], [0, 0, 1.0]])
    lens = Lens(move @ camera.lens.matrix, camera.lens.distortion)
    return Camera.from_projection(camera.name, size, move @ camera.projection, lens)


def main() -> None:
    """Measure, rig by rig."""
    asked, rows = command_line(__doc__).parse_args(), [["rig", "distances", "floor error %", "error %", "stated %"]]
    bench = Bench.of(asked)
    for name, rig, ground, people in chain(real(bench), map(room, range(_ROOMS))):
        places, names = np.random.default_rng(0).choice(ground, _PLACES), [camera.name for camera in rig.cameras]
        known = list(distances(rig, places))
        try:
            solution = calibrate_from_people(names, people, lambda: None)
        except SourceError as refusal:
            print(f"{name}: {refusal}", flush=True)
            continue
        for given in (known[:0], known[:1], known[:3]):
            made = adjusted_to(solution, given) if given else solution
            errors = [f"{100 * one - 100:+.1f}" for one in scales(cameras_of(made, names), rig, places)]
            rows.append([name, str(len(given)), *errors, f"{100 * scale_spread(made, given):.1f}"])
            print(*rows[-1], flush=True)
        write_table(asked.output / "rig_scale.csv", rows)
