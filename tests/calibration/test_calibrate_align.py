"""Rigs turned, shifted and scaled onto a known ground."""

from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from checks import Captured, refused
from simulated_people import ring

from stseg import Recording, Rig, Source, align_rig, read_recording, write_rig
from stseg.commands.calibrate.align import align
from stseg.errors import CalibrationError, OutputError
from stseg.geometry.ground_motion import GroundMotion
from stseg.io.recording.recording import CameraSource

MOTION = GroundMotion(1.1 * np.exp(0.7j), 12.0 - 5.0j)
PLACES = np.array([[-1.0, 0.5], [1.2, -0.8], [0.4, 1.1]])


@pytest.fixture
def room(tmp_path: Path) -> Path:
    rig = replace(ring(3), doors=((-2.5, -1.0, -2.4, 1.0),))
    sources = tuple(CameraSource(Source("video", tmp_path / f"{camera.name}.avi")) for camera in rig.cameras)
    write_rig(tmp_path / "room.toml", Recording(tmp_path / "room.toml", rig, sources))
    return tmp_path / "room.toml"


def points(room: Path, unit: tuple[float, float] = (1.0, 1.0), ahead: bool = True) -> Path:
    """One known place in each view, on the moved ground."""
    lines = ["camera,u,v,x,y"]
    for camera, place in zip(read_recording(room).rig.cameras, PLACES, strict=True):
        (u, v), (x, y) = camera.project(place, 0.0)[0], MOTION.of(place) * unit
        lines.append(f"{camera.name},{u},{v if ahead else -5000},{x},{y}")
    path = room.parent / "points.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def moved_places(rig: Rig, aligned: Rig) -> None:
    """Every view of the aligned rig shows the moved world as the view of the rig shows the world."""
    for before, after in zip(rig.cameras, aligned.cameras, strict=True):
        pixel, _ = before.project(PLACES, np.array([0.0, 1.7, 0.9]))
        again, ahead = after.project(MOTION.of(PLACES), 1.1 * np.array([0.0, 1.7, 0.9]))
        assert ahead.all()
        np.testing.assert_allclose(again, pixel, atol=1e-6)


@pytest.mark.parametrize("metres_per_pixel", [None, 0.02])
def test_a_rig_comes_onto_known_points_and_onto_a_floor_plan(
    room: Path, metres_per_pixel: float | None, capsys: Captured
) -> None:
    unit = (1.0, 1.0) if metres_per_pixel is None else (50.0, -50.0)
    placed = room.parent / "placed.toml"
    align(room, points(room, unit), output=placed, metres_per_pixel=metres_per_pixel)
    aligned, rig = read_recording(placed).rig, read_recording(room).rig
    moved_places(rig, aligned)
    inside = rig.grid.ground[::7, ::7].reshape(-1, 2)
    cells = np.rint(aligned.grid.cell_of(MOTION.of(inside))).astype(int)
    assert aligned.grid.inside()[cells[:, 1], cells[:, 0]].all() and len(aligned.doors) == 1
    assert "turned by 40.1 degrees, scaled by 1.1000, shifted by (12.00, -5.00) m" in capsys.readouterr().out


@pytest.mark.parametrize(("kind", "off"), [("similarity", 0.0), ("rigid", 0.1)])
def test_lengths_are_kept_where_asked(room: Path, kind: Literal["rigid", "similarity"], off: float) -> None:
    found = align_rig(room, points(room), room.parent / "placed.toml", align=kind)
    assert found.scale == pytest.approx(1.1 if kind == "similarity" else 1.0)
    assert max(point.off for point in found.points) == pytest.approx(off, abs=0.06)
    again = align_rig(room, room.parent / "placed.toml", room.parent / "again.toml")
    assert again.scale == pytest.approx(found.scale) and max(point.off for point in again.points) < 1e-6


def test_wrong_points_signs_and_outputs_are_named(room: Path) -> None:
    placed = room.parent / "placed.toml"
    refused(CalibrationError, r"points.csv: y: found a mirrored ground", align_rig, room, points(room, (1, -1)), placed)
    refused(CalibrationError, r"line 2: found a pixel above", align_rig, room, points(room, ahead=False), placed)
    one = points(room)
    one.write_text("\n".join(one.read_text(encoding="utf-8").splitlines()[:2]), encoding="utf-8")
    refused(CalibrationError, r"1 points of one place", align_rig, room, one, placed)
    one.write_text("camera,u,v,x,y\nroof,1,2,3,4\n", encoding="utf-8")
    refused(CalibrationError, r"'roof', expected a camera of the rig: cam1", align_rig, room, one, placed)
    rig = read_recording(room).rig
    downwards = np.array([camera.projection * [1, -1, 1, 1] for camera in rig.cameras])
    sizes = [camera.size for camera in rig.cameras]
    message = r"camera cam1: ground: found a mirrored ground .* change the sign of y"
    refused(CalibrationError, message, Rig.from_projections, downwards, sizes, rig.grid, 5.0)
    align_rig(room, known := points(room), placed)
    refused(OutputError, r"placed.toml: found a file", align_rig, room, known, placed)
    align_rig(room, known, placed, overwrite=True)
    for read in (room, known):
        refused(OutputError, r"a file that is read here", align_rig, room, known, read, overwrite=True)
