"""Tracks in the formats of other programs, read back by those programs."""

import csv
import json
import re
import sqlite3
import sys
import warnings
from contextlib import closing
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any, Literal
from zipfile import ZipFile

import geopandas
import numpy as np
import pedpy
import pyarrow.parquet
import pyproj
import pytest
import shapely
import shapely.geometry
import xarray
from checks import Command, data_path, drawn, refused
from hypothesis import strategies as st
from run_files import FRAMES, small_recording, small_trajectory, table_of, trajectory_of, write_run, write_small_run

from stseg import Grid, Run, Source, read_run
from stseg.arrays import Rows
from stseg.commands.export import export
from stseg.commands.main import main
from stseg.errors import ConfigError
from stseg.io.detections.box_files import read_boxes
from stseg.io.detections.source_detections import read_source
from stseg.io.exports.benchmarks import wildtrack_positions, wildtrack_size
from stseg.io.exports.formats import FORMATS
from stseg.io.exports.geographic import BEGINNING
from stseg.io.exports.movement import headings
from stseg.io.exports.row_counts import ROW_COUNTS
from stseg.io.extras import load_extra
from stseg.records.tables import BOX, TRAJECTORY

with warnings.catch_warnings():  # it tells on import of what it could do with more libraries
    warnings.simplefilter("ignore")
    import movingpandas

EDGES = ("left", "top", "width", "height")
WILDTRACK = Grid((-3.0, 9.0), (-9.0, 27.0))


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return read_run(write_small_run(tmp_path_factory.mktemp("run") / "night.h5"))


def run_of(path: Path, trajectory: Rows) -> Run:
    """A run of six frames with these rows and nothing else."""
    return read_run(write_run(path, small_recording(path.parent), trajectory))


@pytest.fixture(scope="module")
def empty_run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Six frames without detections."""
    return run_of(tmp_path_factory.mktemp("run") / "empty.h5", trajectory_of())


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "tracks.out"


def in_order_of_ids(table: Rows) -> Rows:
    return np.sort(table, order=["id", "frame"])


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_is_written_by_its_name_and_twice_the_same(run: Run, tmp_path: Path, name: str) -> None:
    outputs = [tmp_path / "one", tmp_path / "two"]
    for output in outputs:
        assert main(["export", str(run.path), "--to", name, "-o", str(output)]) == 0
    first, second = (output.read_bytes() for output in outputs)
    assert len(first) > 100 and first == second


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_takes_a_run_without_tracks(empty_run: Run, path: Path, name: str) -> None:
    FORMATS[name].write(path, empty_run)
    assert path.exists()


def test_help_names_every_format(stdout: Command) -> None:
    shown = stdout("export", "--help")
    assert all(re.search(rf"(^|\s){name}:", shown, re.MULTILINE) for name in FORMATS)


@drawn(
    30, there=st.lists(st.lists(st.booleans(), min_size=3, max_size=3), min_size=6, max_size=6), seed=st.integers(0, 99)
)
def test_gaps_come_back(tmp_path_factory: pytest.TempPathFactory, there: list[list[bool]], seed: int) -> None:
    folder = tmp_path_factory.mktemp("gaps")
    frame, identity = np.nonzero(np.array(there, bool))
    x, y = np.random.default_rng(seed).uniform(0, 0.4, (2, len(frame))).round(4)
    table = table_of(TRAJECTORY, frame=FRAMES[frame], id=5 + 2 * identity, x=x, y=y)
    run = run_of(folder / "run.h5", table)
    for name in ("movement", "jupedsim", "mf-json"):
        FORMATS[name].write(folder / name, run)
    expected = in_order_of_ids(table)[["id", "frame", "x", "y"]].tolist()
    with closing(sqlite3.connect(folder / "jupedsim")) as database:
        rows = database.execute("SELECT id, frame, pos_x, pos_y FROM trajectory_data ORDER BY id, frame").fetchall()
    assert rows == expected
    rows = [
        (feature["id"], round(5 * (datetime.fromisoformat(time) - BEGINNING).total_seconds()), *place)
        for feature in json.loads((folder / "mf-json").read_text("utf-8"))["features"]
        for time, place in zip(*(feature["temporalGeometry"][key] for key in ("datetimes", "coordinates")), strict=True)
    ]
    assert rows == expected
    with xarray.open_dataset(folder / "movement", engine="h5netcdf") as data:
        places = data.position.isel(keypoint=0).transpose("individual", "time", "space").values
        names = data.individual.values.tolist()
    found = [
        (int(names[i][3:]), int(FRAMES[t]), *places[i, t].tolist())
        for i, t in zip(*np.nonzero(np.isfinite(places[..., 0])), strict=True)
    ]
    assert found == expected


@pytest.mark.parametrize(("name", "library"), [("parquet", "pyarrow"), ("movement", "h5netcdf")])
def test_a_library_that_is_missing_is_asked_for_in_one_line(
    run: Run, path: Path, monkeypatch: pytest.MonkeyPatch, refusal: Command, name: str, library: str
) -> None:
    monkeypatch.setitem(sys.modules, library, None)
    said = f"{library}: found no such library, expected it: pip install 'stseg[{name}]'"
    assert said in refusal("export", run.path, "--to", name, "-o", path) and not list(path.parent.iterdir())
    refused(ConfigError, "Python: nowhere: found no such library", load_extra, "nowhere.at_all", "parquet")


def test_parquet_and_napari_hold_columns_and_rows_in_order(run: Run, path: Path) -> None:
    FORMATS["parquet"].write(path, run)
    table = pyarrow.parquet.read_table(path)
    assert table.column_names == [*(TRAJECTORY.names or ()), "time"]
    for name in TRAJECTORY.names or ():
        np.testing.assert_array_equal(table[name].to_numpy(), run.trajectory[name])
        assert table[name].to_numpy().dtype == TRAJECTORY[name]
    np.testing.assert_allclose(table["time"].to_numpy(), run.trajectory["frame"] / 5)
    assert table.schema.field("x").metadata == {b"units": b"m"}
    about = json.loads(table.schema.metadata[b"stseg"])
    assert about == {"scene": "hall", "frame_rate": 5.0, "cameras": ["left", "right"]}
    FORMATS["napari"].write(path, run)
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["particle", "frame", "z", "y", "x", "score", "height"]
    expected = in_order_of_ids(run.trajectory)
    assert [(int(row["particle"]), int(row["frame"])) for row in rows] == expected[["id", "frame"]].tolist()
    np.testing.assert_allclose([float(row["x"]) for row in rows], expected["x"], atol=1e-4)


def same_for_pedpy(data: pedpy.TrajectoryData) -> None:
    expected = in_order_of_ids(small_trajectory())
    found = data.data.sort_values(["id", "frame"])
    assert data.frame_rate == 5.0
    for name in ("id", "frame"):
        assert found[name].tolist() == expected[name].tolist()
    for name in ("x", "y"):
        np.testing.assert_allclose(found[name], expected[name], atol=1e-4)


def test_pedpy_reads_its_text_and_jupedsim_s_database(run: Run, path: Path) -> None:
    FORMATS["pedpy"].write(path.with_suffix(".txt"), run)
    same_for_pedpy(pedpy.load_trajectory(trajectory_file=path.with_suffix(".txt")))
    path.write_text("left behind by a run that was killed")
    FORMATS["jupedsim"].write(path, run)
    same_for_pedpy(pedpy.load_trajectory_from_jupedsim_sqlite(trajectory_file=path))
    area = pedpy.load_walkable_area_from_jupedsim_sqlite(trajectory_file=path)
    assert area.polygon.equals(shapely.box(0, 0, 0.6, 0.4))
    with closing(sqlite3.connect(path)) as database:
        frames = database.execute("SELECT frame FROM frame_data JOIN geometry ON geometry_hash = hash").fetchall()
    assert [frame for (frame,) in frames] == FRAMES.tolist()


def test_jupedsim_replays_its_database(run: Run, path: Path) -> None:
    recording = pytest.importorskip("jupedsim.recording", reason="jupedsim is not installed")
    FORMATS["jupedsim"].write(path, run)
    found = recording.Recording(str(path))
    assert (found.num_frames, found.fps, found.bounds().xmax) == (len(FRAMES), 5.0, 0.6)
    here = run.trajectory[run.trajectory["frame"] == FRAMES[-1]]
    shown = [(agent.id, *agent.position) for agent in found.frame(int(FRAMES[-1])).agents]
    assert shown == here[["id", "x", "y"]].tolist()


def test_people_look_where_they_go_and_stay_in_the_grid() -> None:
    table = trajectory_of((0, 1, 0, 0), (0, 2, 7, 7), (1, 1, 0, 4), (1, 3, 9, 9), (2, 1, 3, 4))
    np.testing.assert_allclose(headings(table), [(0, 1), (1, 0), (0.6, 0.8), (1, 0), (1, 0)])
    assert headings(table[:0]).shape == (0, 2)
    rows = trajectory_of((0, 1, -3.2, -9.4), (0, 2, 9.0, 27.0))
    assert wildtrack_positions(rows, WILDTRACK).tolist() == [0, 480 * 1440 - 1]


def test_mot_boxes_are_one_file_a_camera_that_reads_as_boxes(run: Run, path: Path) -> None:
    FORMATS["mot-boxes"].write(path, run)
    with ZipFile(path) as archive:
        assert archive.namelist() == ["left.txt", "right.txt"]
        assert archive.read("left.txt").decode() == "11,1,1.00,2.00,3.00,4.00,1,-1,-1,-1\n"
        assert archive.read("right.txt") == b""
        boxes = read_boxes(Path(archive.extract("left.txt", path.parent)), first_frame=1)
    assert (boxes.frame.tolist(), boxes.pixel[:].tolist()) == ([10], [[1.0, 2.0, 3.0, 4.0]])


@pytest.mark.parametrize(("name", "of_camera"), [("coco", ""), ("cvat", "{}.xml"), ("label-studio", "{}.json")])
def test_mended_annotations_come_back_as_boxes(run: Run, path: Path, name: str, of_camera: str) -> None:
    """People come, are hidden for a frame and go, in two views."""
    path = path.with_suffix(".json")
    boxes = table_of(BOX, frame=[10, 11, 13, 14, 15, 12], id=[1, 1, 1, 2, 2, 2], view=[0, 0, 0, 0, 0, 1])
    for k, edge in enumerate(EDGES):
        boxes[edge] = np.arange(6) + 10 * k + 1.25
    rich = replace(run)
    rich.__dict__["boxes"] = boxes
    FORMATS[name].write(path, rich)
    assert ROW_COUNTS[name](path) == 6
    for view, camera in enumerate(run.recording.rig.cameras):
        file, first = path, int(FRAMES[0])  # a list of images counts from its first
        if of_camera:
            with ZipFile(path) as archive:
                file, first = Path(archive.extract(of_camera.format(camera.name), path.parent)), 0
        table = read_source(Source("boxes", file, select="" if of_camera else f"{camera.name}/*"), camera.size).table
        rows = boxes[boxes["view"] == view]
        np.testing.assert_array_equal(table.frame + first, rows["frame"])
        np.testing.assert_allclose(table.pixel[:], [[row[edge] for edge in EDGES] for row in rows], atol=0.01)


def wildtrack_files(path: Path) -> tuple[dict[str, Any], dict[int, list[dict[str, Any]]]]:
    with ZipFile(path) as archive:
        grid, *names = archive.namelist()
        people = {int(Path(name).stem): json.loads(archive.read(name)) for name in names}
        assert {str(Path(name).parent) for name in names} == {"annotations_positions"}
        return json.loads(archive.read(grid)), people


def test_wildtrack_has_its_grid_and_members_of_its_own_files(run: Run, path: Path) -> None:
    FORMATS["wildtrack"].write(path, run)
    grid, people = wildtrack_files(path)
    assert grid == {"x": 0, "y": 0, "step": 0.025, "columns": 24, "rows": 16}
    assert list(people) == FRAMES.tolist()
    (first,) = people[10]
    assert list(first) == ["personID", "positionID", "views"]
    assert first["views"] == [
        {"viewNum": 0, "xmin": 1, "ymin": 2, "xmax": 4, "ymax": 6},
        {"viewNum": 1, "xmin": -1, "ymin": -1, "xmax": -1, "ymax": -1},
    ]
    for row in run.trajectory:
        (person,) = (one for one in people[int(row["frame"])] if one["personID"] == row["id"])
        position = person["positionID"]
        assert abs(0.025 * (position % 24) - row["x"]) <= 0.0126
        assert abs(0.025 * (position // 24) - row["y"]) <= 0.0126
    theirs = min(data_path("wildtrack/annotations_positions").glob("*.json"))
    ((person, *_), *_), (one, *_) = people.values(), json.loads(theirs.read_text("utf-8"))
    assert set(person) == set(one) and set(person["views"][0]) == set(one["views"][0])
    assert {type(value) for value in person["views"][0].values()} == {int}


@drawn(100, position=st.integers(0, 480 * 1440 - 1))
def test_over_wildtrack_s_area_the_grid_is_its_own(position: int) -> None:
    assert wildtrack_size(WILDTRACK) == (480, 1440)
    row = trajectory_of((0, 1, -3 + 0.025 * (position % 480), -9 + 0.025 * (position // 480)))
    assert wildtrack_positions(row, WILDTRACK).tolist() == [position]


def test_movement_s_poses_and_boxes_in_xarray(run: Run, path: Path) -> None:
    FORMATS["movement"].write(path, run)
    with xarray.open_dataset(path, engine="h5netcdf") as data:
        assert data.position.dims == ("time", "space", "keypoint", "individual")
        assert data.confidence.dims == ("time", "keypoint", "individual")
        assert data.space.values.tolist() == ["x", "y"]
        assert data.individual.values.tolist() == ["id_1", "id_2"]
        assert [data.attrs[name] for name in ("ds_type", "fps", "time_unit")] == ["poses", 5.0, "seconds"]
        np.testing.assert_allclose(data.time, FRAMES / 5)
        ground = data.position.sel(keypoint="ground", individual="id_2").values
        assert np.isnan(ground[:3]).all()
        np.testing.assert_allclose(ground[3:], [(0.3, 0.2)] * 3)
        np.testing.assert_allclose(data.confidence.sel(individual="id_1"), 1 / (1 + np.exp(-4.0)), rtol=1e-6)
    FORMATS["movement-boxes"].write(path, run)
    with xarray.open_dataset(path, engine="h5netcdf") as data:
        assert data.position.dims == data["shape"].dims == ("view", "time", "space", "individual")
        one = data.sel(view="left", individual="id_1").isel(time=0)
        assert one.position.values.tolist() == [2.5, 4.0] and one["shape"].values.tolist() == [3.0, 4.0]
        assert float(one.confidence) == pytest.approx(1 / (1 + np.exp(-4.0)))
        assert int(data.position.notnull().sum()) == 2


@pytest.mark.parametrize("name", ["movement", "movement-boxes"])
def test_movement_takes_its_datasets(run: Run, path: Path, name: str) -> None:
    datasets = pytest.importorskip("movement.validators.datasets", reason="movement is not installed")
    FORMATS[name].write(path, run)
    validators = {"poses": datasets.ValidPosesInputs, "bboxes": datasets.ValidBboxesInputs}
    with xarray.open_dataset(path, engine="h5netcdf") as data:
        validator = validators[data.attrs["ds_type"]]
        if "individuals" in validator.DIM_NAMES:  # before 0.17
            old = {"individual": "individuals", "keypoint": "keypoints"}
            data = data.rename({new: name for new, name in old.items() if new in data.dims})
        validator.validate(data)


@pytest.mark.filterwarnings("ignore:The inplace keyword")  # of pandas, to movingpandas
@pytest.mark.filterwarnings("ignore:Time zone information dropped")  # by movingpandas: it has none
def test_movingpandas_reads_moving_features(run: Run, path: Path) -> None:
    FORMATS["mf-json"].write(path, run)
    collection = movingpandas.read_mf_json(path, traj_id_property="id")
    assert [trajectory.id for trajectory in collection.trajectories] == [1, 2]
    second = collection.trajectories[1].df
    np.testing.assert_allclose(second.geometry.x, 0.3)
    np.testing.assert_allclose(second["score"], 4.0)
    seconds = (second.index - np.datetime64("1970-01-01")).total_seconds()
    np.testing.assert_allclose(seconds, FRAMES[3:] / 5)


def test_features_are_those_of_geopandas_and_of_ogc(run: Run, path: Path) -> None:
    FORMATS["geojson"].write(path.with_suffix(".geojsonl"), run)
    features = [json.loads(line) for line in path.with_suffix(".geojsonl").read_text("utf-8").splitlines()]
    shapes = [shapely.geometry.shape(feature["geometry"]) for feature in features]
    assert [(shape.geom_type, len(shape.coords)) for shape in shapes] == [("LineString", 6), ("LineString", 3)]
    assert features[1]["properties"] == {
        "id": 2, "height": 1.7, "score": 4.0, "first": 13, "last": 15, "start": 2.6, "duration": 0.4
    }  # fmt: skip
    frame = geopandas.read_file(path.with_suffix(".geojsonl"), driver="GeoJSONSeq")
    assert frame["id"].tolist() == [1, 2]
    FORMATS["mf-json"].write(path, run)
    text = json.loads(path.read_text("utf-8"))
    assert text["type"] == "FeatureCollection"
    system = pyproj.CRS.from_user_input(text["crs"]["properties"]["name"])
    assert [axis.unit_name for axis in system.axis_info] == ["metre", "metre"]
    first = text["features"][0]
    assert first["temporalGeometry"]["type"] == "MovingPoint"
    assert first["temporalGeometry"]["datetimes"][:2] == ["1970-01-01T00:00:02.000Z", "1970-01-01T00:00:02.200Z"]
    assert first["time"] == ["1970-01-01T00:00:02.000Z", "1970-01-01T00:00:03.000Z"]
    lengths = {len(first["temporalGeometry"][name]) for name in ("datetimes", "coordinates")}
    assert lengths == {len(first["temporalProperties"][0]["score"]["values"])} == {6}


def test_one_place_is_a_point_and_no_number_is_null(tmp_path: Path) -> None:
    run = run_of(tmp_path / "one.h5", table_of(TRAJECTORY, id=7, frame=12, score=np.nan, height=np.nan))
    for name in ("geojson", "mf-json", "csv", "parquet"):
        FORMATS[name].write(tmp_path / name, run)
    assert (tmp_path / "csv").read_text("utf-8").splitlines()[1] == "12,7,0.0000,0.0000,,,0,0,0,0"
    assert pyarrow.parquet.read_table(tmp_path / "parquet").column("height").null_count == 1
    (feature,) = (json.loads(line) for line in (tmp_path / "geojson").read_text("utf-8").splitlines())
    assert feature["geometry"] == {"type": "Point", "coordinates": [0.0, 0.0]}
    (moving,) = json.loads((tmp_path / "mf-json").read_text("utf-8"))["features"]
    assert moving["temporalProperties"][0]["score"]["values"] == [None]
    assert moving["properties"] == {"id": 7, "height": None, "score": None}


QUESTION = (
    "SELECT r.recording, COUNT(*), MAX(t.x) FROM recordings r JOIN trajectory t USING (recording) GROUP BY 1 ORDER BY 1"
)


@pytest.fixture
def runs(tmp_path: Path) -> list[Path]:
    return [write_small_run(tmp_path / f"{name}.h5") for name in ("monday", "tuesday")]


@pytest.mark.parametrize("to", ["sqlite", "duckdb"])
def test_a_database_holds_all_runs(runs: list[Path], path: Path, to: Literal["sqlite", "duckdb"]) -> None:
    library = pytest.importorskip({"sqlite": "sqlite3"}.get(to, to))
    export(*runs, to=to, output=path)
    with closing(library.connect(str(path))) as connection:
        assert connection.execute(QUESTION).fetchall() == [("monday", 9, 0.3), ("tuesday", 9, 0.3)]
        assert connection.execute("SELECT COUNT(*), SUM(frames) FROM tracks").fetchone() == (4, 18)
        assert connection.execute("SELECT DISTINCT kind FROM events").fetchall() == [("birth",)]


def test_many_runs_need_a_database_and_names_of_their_own(runs: list[Path], path: Path) -> None:
    refused(ConfigError, "2 run files, expected one, or --to sqlite or duckdb", export, *runs, to="csv", output=path)
    refused(ConfigError, "monday twice", export, runs[0], runs[0], to="sqlite", output=path)
