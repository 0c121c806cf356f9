"""Measures of tracks with numbers known by construction."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from checks import Captured, cases, refused
from run_files import table_of, trajectory_of, write_small_run
from scipy.signal import lfilter

import stseg
from stseg.arrays import Floats, Rows
from stseg.commands.measure import measure as measure_command
from stseg.errors import FormatError
from stseg.geometry import Grid
from stseg.io.areas import read_lines, read_polygons
from stseg.measures import Areas, Line, Zone, measure_tracks
from stseg.measures.motion import motions
from stseg.records.tables import TRAJECTORY

GRID = Grid((-5.0, 5.0), (-2.0, 2.0), 0.1)
SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
UP = Line("up", np.array([[0.0, -2.0], [0.0, 2.0]]))


def walk(identity: int, x: Floats, y: float | Floats = 0.0, score: float = 9.0) -> Rows:
    return table_of(TRAJECTORY, frame=np.arange(len(x)), id=identity, x=x, y=y, score=score)


def test_one_who_walks_through() -> None:
    """1 m/s from x = -4 to 4 in 8 s at 10 frames a second."""
    areas = Areas((Zone("z", (SQUARE,)),), (UP,))
    found = measure_tracks(walk(1, np.linspace(-4, 4, 81)), np.arange(81), 10.0, GRID, areas)
    (zone,), (line,), (track,) = found.zones, found.lines, found.tracks
    assert (zone["entries"], zone["exits"], zone["visits"], zone["most_people"]) == (1, 1, 1, 1)
    assert zone["median_dwell"] == pytest.approx(2.0, abs=0.11) and zone["area"] == 4
    assert zone["mean_people"] == pytest.approx(20 / 81, abs=0.02)
    assert (line["left"], line["right"]) == (0, 1)
    assert found.crossings["time"][0] == pytest.approx(4.0) and found.crossings["speed"][0] == pytest.approx(1.0)
    assert track["distance"] == pytest.approx(8.0) and track["mean_speed"] == pytest.approx(1.0)
    assert not len(found.spacing) and found.motion[40].tolist() == pytest.approx((40, 1, 1, 0, 0, 0, 0, 0), abs=1e-9)
    row = found.field[(found.field["x"] == 0.25) & (found.field["y"] == 0.25)][0]
    assert row["flow_x"] == pytest.approx(row["density"] * 1.0, rel=1e-6) and abs(row["flow_y"]) < 1e-9


def test_motion_has_the_uncertainty_of_places() -> None:
    """A circle of 2 m at 1 m/s, by places that err by 0.1 m, alike for half a second."""
    lots, angle, alike = np.random.default_rng(3), np.arange(6000) / 20, np.exp(-0.2)
    errors = lfilter([0.1 * (1 - alike**2) ** 0.5], [1, -alike], lots.normal(size=(2, 6000)))
    rows = walk(1, 2 * np.cos(angle) + errors[0], 2 * np.sin(angle) + errors[1])
    rows["xx"] = rows["yy"] = 0.01
    found = motions(rows, 10.0)[10:-10]
    turned = np.angle(np.exp(1j * (found["heading"] - angle[10:-10] - np.pi / 2)))
    for off, deviation in ((found["speed"] - 1, "speed"), (turned, "heading"), (found["acceleration"], "acceleration")):
        assert 0.55 < (np.abs(off) < found[f"{deviation}_deviation"]).mean() < 0.75


def test_standing_on_a_line_and_being_away_are_no_traffic() -> None:
    sway = np.concatenate([np.linspace(-2, -0.02, 20), 0.05 * (-1.0) ** np.arange(41), np.linspace(0.02, 2, 20)])
    assert measure_tracks(walk(1, sway), np.arange(81), 10.0, GRID, Areas((), (UP,))).lines["right"].tolist() == [1]
    back = np.concatenate([np.linspace(-2, 1, 31), np.linspace(1, -2, 31)])
    (line,) = measure_tracks(walk(1, back), np.arange(62), 10.0, GRID, Areas((), (UP,))).lines
    assert (line["left"], line["right"]) == (1, 1)
    # A person leaves to the left of a line and comes back on its right a minute later.
    first, second = walk(1, np.linspace(-0.5, -2.0, 16)), walk(1, np.linspace(2.0, 0.5, 16))
    second["frame"] += 600
    found = measure_tracks(np.concatenate([first, second]), np.arange(700), 10.0, GRID, Areas((), (UP,)))
    assert not len(found.crossings)
    (track,) = found.tracks
    assert (track["first"], track["last"]) == (0, 615)
    assert track["distance"] == pytest.approx(3.0) and track["seconds"] == pytest.approx(3.2)


def test_counts_have_the_uncertainty_of_scores_and_places() -> None:
    still = [walk(k, np.zeros(50), 0.1 * k, score=0.0) for k in range(4)]
    found = measure_tracks(np.concatenate(still), np.arange(50), 10.0, GRID, Areas((Zone("z", (SQUARE,)),)))
    assert found.people["people"].tolist() == [4] * 50
    np.testing.assert_allclose(found.people["expected"], 2.0)
    np.testing.assert_allclose(found.people["deviation"], np.hypot(1.0, 0.05 * 2.0), err_msg="and of people missed")
    np.testing.assert_allclose(found.spacing["nearest"], 0.1)
    border = walk(1, np.repeat([0.95, 1.0, 1.1, 4.0], 10))
    border["xx"] = border["yy"] = 0.1**2
    found = measure_tracks(border, np.arange(40), 10.0, GRID, Areas((Zone("z", (SQUARE,)),)))
    np.testing.assert_allclose(found.people["expected"][::10], [0.691, 0.5, 0.159, 0.0], atol=1e-3)
    inside = found.people["expected"] @ np.ones(40) / 40
    brief = (found.people["expected"] * (1 - found.people["expected"])).sum() * 10.0 / 40**2
    assert found.zones["deviation"][0] == pytest.approx(np.hypot(np.sqrt(brief), 0.05 * inside), abs=1e-3)
    edge = Line("", np.concatenate([SQUARE, SQUARE[:1]]))
    np.testing.assert_allclose(edge.distance(np.array([[0.0, 0.0], [0.9, 0.2], [2.0, 2.0]])), [1.0, 0.1, np.sqrt(2)])


def test_short_absences_do_not_end_a_visit_and_holes_are_outside() -> None:
    x = np.concatenate([np.zeros(20), np.full(5, 1.2), np.zeros(20), np.full(30, 2.0)])
    zone = Zone("z", (SQUARE, 0.1 * SQUARE + [0.5, 0.5]))
    found = measure_tracks(walk(1, x), np.arange(75), 10.0, GRID, Areas((zone,)))
    (visit,) = found.visits
    assert (visit["first"], visit["last"], bool(visit["entered"]), bool(visit["left"])) == (0, 44, False, True)
    assert zone.area_on(GRID) == pytest.approx(3.96)
    assert zone.contains(np.array([[0.5, 0.5], [0.0, 0.0]])).tolist() == [False, True]


@pytest.mark.parametrize(
    ("rings", "area"),
    [
        ([[(2, -1), (3, -1), (3, 1), (2, 1)], [(2.5, -1), (4, -1), (4, -2), (2.5, -2)]], 3.5),  # they share an edge
        ([[(-1, -1), (1, -1), (1, 1), (-1, 1)], [(1, 0), (0, 1), (-1, 0), (0, -1)]], 2.0),  # a hole touches the border
        ([[(0, 0), (2, 2), (2, 0), (0, 2)]], 2.0),  # two triangles, as for `contains`
        ([[(4, 0), (7, 0), (7, 3), (4, 3)]], 2.0),  # of which two square metres lie within the ground
    ],
)
def test_area_is_what_counts_of_touching_rings(rings: list[list[tuple[float, float]]], area: float) -> None:
    zone = Zone("z", tuple(np.array(ring, float) for ring in rings))
    assert zone.area_on(GRID) == pytest.approx(area)
    found = measure_tracks(trajectory_of(), np.arange(5), 10.0, GRID, Areas((Zone("z", (SQUARE,)),), (UP,)))
    assert found.people["people"].tolist() == [0] * 5 and not len(found.tracks) and found.field["density"].sum() == 0


def feature(kind: str, coordinates: object, name: str = "a") -> dict[str, object]:
    return {"type": "Feature", "properties": {"name": name}, "geometry": {"type": kind, "coordinates": coordinates}}


@pytest.fixture
def zone_file(tmp_path: Path) -> Path:
    path = tmp_path / "zones.geojson"
    ring = [[0, 0], [0.3, 0], [0.3, 0.4], [0, 0.4], [0, 0]]
    path.write_text(json.dumps({"type": "FeatureCollection", "features": [feature("Polygon", [ring], "left half")]}))
    return path


def test_command_and_python_agree(tmp_path: Path, zone_file: Path, capsys: Captured) -> None:
    run = write_small_run(tmp_path / "run.h5")
    line = tmp_path / "line.geojson"
    line.write_text(json.dumps(feature("LineString", [[0.2, 0], [0.2, 0.4]])))
    measure_command(run, output=tmp_path / "m", zones=zone_file, lines=line)
    assert "left half" in capsys.readouterr().out
    with (tmp_path / "m" / "zones.csv").open() as file:
        (row,) = csv.DictReader(file)
    found = stseg.measure(stseg.read_run(run), zone_file, line)
    assert float(row["mean_people"]) == pytest.approx(float(found.zones["mean_people"][0]))
    assert row["most_people"] == "1"
    names = {path.name for path in (tmp_path / "m").iterdir()}
    assert names == {*(f"{name}.csv" for name in found.tables()), "flow.png"}
    parquet = pytest.importorskip("pyarrow.parquet")
    measure_command(run, output=tmp_path / "p", format_="parquet")
    assert parquet.read_table(tmp_path / "p" / "zones.parquet").to_pylist()[0]["zone"] == "ground"


@cases(
    (json.dumps(feature("Polygon", [[[0, 0]] * 20_000])), "a: found 20000 points, expected at most 10000"),
    (json.dumps(feature("MultiPolygon", [[[[0, 0]] * 6000] * 2])), "a: found 12000 corners or more"),
)
def test_malformed_geojson_is_named(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "zones.geojson"
    path.write_text(text)
    refused(FormatError, message, read_polygons, path)
    refused(FormatError, "found", read_lines, path)


def test_areas_lie_on_the_ground_and_need_not_be_closed(tmp_path: Path) -> None:
    run, path = write_small_run(tmp_path / "run.h5"), tmp_path / "areas.geojson"
    path.write_text(json.dumps(feature("Polygon", [[[11.5, 48.1], [11.6, 48.1], [11.6, 48.2]]])))
    match = r"areas.geojson: zone a: found x 11.5 to 11.6, y 48.1 to 48.2, expected metres on the ground, which is x"
    refused(FormatError, match, stseg.measure, run, path)
    path.write_text(json.dumps(feature("LineString", [[-90, 0], [-80, 0]])))
    refused(FormatError, "line a: found x -90 to -80", stseg.measure, run, None, path)
    path.write_text(json.dumps(feature("Polygon", [[[0, 0], [0.5, 0.3], [0.5, 0], [0, 0.3]]])))
    refused(FormatError, "zone a: found Self-intersection", stseg.measure, run, path)
    path = tmp_path / "zones.geojson"
    path.write_text(json.dumps(feature("Polygon", [[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 0], [1, 1], [0, 0]]])))
    ((_, (open_ring, closed_ring)),) = read_polygons(path)
    np.testing.assert_array_equal(open_ring, closed_ring)
