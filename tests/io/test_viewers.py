"""A run file as other programs see it: HDF5, silx, xarray, PedPy, napari, pandas."""

import sys
import tomllib
import warnings
import zlib
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas
import pedpy
import pytest
import shapely
import silx.io
import silx.io.nxdata
import xarray
from checks import data_path, refused
from run_files import FRAMES, small_ghosts, small_trajectory, small_volume, write_small_run

from stseg.commands.main import main
from stseg.errors import ConfigError
from stseg.io.runfile import layout
from stseg.io.runfile.packed_frames import PackedFrame, packed_frame, unpacked_label
from stseg.io.runfile.reading.napari_reader import get_reader, read_layers
from stseg.io.runfile.runs import read_run

ROOT = Path(__file__).parents[2]
AXES = {
    "time": ("s", FRAMES / 5),
    "plane": ("m", np.array([0, 0.9, 1.8])),
    "y": ("m", np.array([0.05, 0.15, 0.25, 0.35])),
    "x": ("m", np.array([0.05, 0.15, 0.25, 0.35, 0.45, 0.55])),
}
SHAPE = (3, 5, 7)
UU4_FRAMES = 24


@pytest.fixture(scope="module")
def run_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_small_run(tmp_path_factory.mktemp("run") / "night.h5")


def test_silx_and_pedpy_open_the_run_file_by_its_addresses(run_path: Path) -> None:
    with silx.io.open(str(run_path)) as file:
        shown = silx.io.nxdata.get_default(file)
        assert shown is not None and shown.is_valid
        assert shown.group.name == layout.OCCUPANCY
        assert (shown.signal_dataset_name, shown.signal.shape) == ("log_odds", (6, 3, 4, 6))
        assert shown.interpretation == "image" and shown.auxiliary_signals_dataset_names == ["label"]
        assert shown.axes_dataset_names == list(AXES)
        for axis, name in zip(shown.axes, AXES, strict=True):
            units, values = AXES[name]
            assert axis.attrs["units"] == units
            assert axis.attrs["long_name"].endswith(f"({units})")  # all that silx writes at the axis
            np.testing.assert_allclose(axis[()], values)
        np.testing.assert_array_equal(shown.auxiliary_signals[0][()], small_volume()[1])
    frame = silx.io.get_data(f"silx:{run_path}?path={layout.OCCUPANCY}/log_odds&slice=2")
    np.testing.assert_allclose(frame, small_volume()[0][2], rtol=1e-3)
    table = silx.io.get_data(f"silx:{run_path}?path=/trajectory")
    np.testing.assert_array_equal(table["x"], small_trajectory()["x"])
    data = pedpy.load_trajectory_from_ped_data_archive_hdf5(trajectory_file=run_path)
    assert data.frame_rate == 5.0
    found = data.data.sort_values(["frame", "id"])
    for name in ("frame", "id", "x", "y", "score"):
        np.testing.assert_array_equal(found[name], small_trajectory()[name])
    area = pedpy.load_walkable_area_from_ped_data_archive_hdf5(trajectory_file=run_path)
    assert area.polygon.equals(shapely.box(0, 0, 0.6, 0.4))
    density = pedpy.compute_classic_density(traj_data=data, measurement_area=pedpy.MeasurementArea(area.polygon))
    np.testing.assert_allclose(density["density"], [1 / 0.24] * 3 + [2 / 0.24] * 3)


def test_xarray_has_named_axes_with_units_and_selects_by_them(run_path: Path) -> None:
    with xarray.open_dataset(run_path, group="entry/occupancy", engine="h5netcdf", phony_dims="access") as data:
        assert data.log_odds.dims == data.label.dims == tuple(AXES)
        assert data.views.dims == ("plane", "y", "x") and data.frame.dims == ("time",)
        for name, (units, values) in AXES.items():
            assert data[name].attrs["units"] == units
            np.testing.assert_allclose(data[name], values)
        log_odds, label = small_volume()
        np.testing.assert_allclose(data.log_odds, log_odds, rtol=1e-3)
        assert data.log_odds.attrs["units"] == "nat"
        place = data.label.sel(time=2.8, x=0.44, y=0.26, plane=1.0, method="nearest")
        assert int(place) == label[4, 1, 2, 4] == 2


def test_tables_as_data_frames_where_pandas_is(run_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = read_run(run_path)
    table = run.data_frame("trajectory")
    assert list(table.columns) == [*(run.trajectory.dtype.names or ()), "time"]
    np.testing.assert_array_equal(table["x"], run.trajectory["x"])
    np.testing.assert_allclose(table.groupby("id")["time"].max(), [3.0, 3.0])
    assert run.data_frame("events")[["kind", "reason"]].to_numpy().T.tolist() == [["birth"] * 2, ["start", "entered"]]
    ghosts = run.data_frame("ghosts")
    np.testing.assert_array_equal(ghosts["parts_left"], small_ghosts()["parts"][:, 0])
    assert "parts_right" in ghosts
    for name in layout.ABOUT:
        assert isinstance(run.data_frame(name), pandas.DataFrame)
    refused(ValueError, "table 'people' is none of trajectory", run.data_frame, "people")
    monkeypatch.setitem(sys.modules, "pandas", None)
    refused(ConfigError, r"pip install 'stseg\[pandas\]'", read_run(run_path).data_frame, "tracks")


def test_napari_s_layers_are_in_seconds_metres_and_on_disk(run_path: Path) -> None:
    reader = get_reader(str(run_path))
    assert reader is not None
    (volume, about, kind), (label, about_label, kind_label), (tracks, about_tracks, kind_tracks) = reader(str(run_path))
    assert (kind, kind_label, kind_tracks) == ("image", "labels", "tracks")
    np.testing.assert_allclose(volume[2], small_volume()[0][2], rtol=1e-3)
    np.testing.assert_array_equal(label[2], small_volume()[1][2])
    for meta in (about, about_label):
        for name, index in (("x", -1), ("y", -2), ("plane", -3), ("time", 0)):
            values = AXES[name][1]
            assert meta["scale"][index] == pytest.approx(values[1] - values[0])
            assert meta["translate"][index] == pytest.approx(values[0])
    for meta in (about, about_label, about_tracks):
        assert meta["axis_labels"] == tuple(AXES) and meta["units"] == ("s", "m", "m", "m")
    low, high = about["contrast_limits"]
    assert (low, high) == (0.0, pytest.approx(float(np.nanmax(small_volume()[0][3])), rel=1e-3))
    world = tracks[:, 1:] * about_tracks["scale"] + about_tracks["translate"]
    expected = np.sort(small_trajectory(), order=["id", "frame"])
    assert tracks[:, 0].tolist() == about_tracks["features"]["id"].tolist() == expected["id"].tolist()
    np.testing.assert_allclose(world[:, 0], expected["frame"] / 5)
    np.testing.assert_allclose(world[:, 2:], np.stack([expected["y"], expected["x"]], -1))
    (stored, _, _), (names, _, _), _ = read_layers(str(run_path))
    assert isinstance(stored, h5py.Dataset) and isinstance(names, h5py.Dataset)


def test_napari_s_other_files_are_left_to_others(run_path: Path, tmp_path: Path) -> None:
    (tmp_path / "text.h5").write_text("no HDF5")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["something"] = 1
    for path in (tmp_path / "text.h5", tmp_path / "other.h5", tmp_path / "nowhere.h5", tmp_path):
        assert get_reader(str(path)) is None
    assert get_reader([str(run_path), str(run_path)]) is None


def test_the_manifest_leads_npe2_to_the_reader(run_path: Path) -> None:
    with warnings.catch_warnings():  # its models warn of pydantic's changes when they are made
        warnings.simplefilter("ignore")
        npe2: Any = pytest.importorskip("npe2", reason="npe2 is not installed")
    manifest = npe2.PluginManifest.from_file(ROOT / "stseg" / "napari.yaml")
    manifest.validate_imports()
    manager = npe2.PluginManager(disable=[])
    manager.register(manifest)
    manager.activate("stseg")
    (contribution,) = manager.iter_compatible_readers([str(run_path)])
    assert contribution.plugin_name == "stseg"
    layers = contribution.exec(kwargs={"path": [str(run_path)], "stack": False, "_registry": manager.commands})
    assert [kind for _, _, kind in layers([str(run_path)], stack=False)] == ["image", "labels", "tracks"]
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    assert project["project"]["entry-points"]["napari.manifest"] == {"stseg": "stseg:napari.yaml"}


@pytest.fixture
def label() -> np.ndarray:
    """Labels of one frame, some of which need all four bytes."""
    chosen = np.random.default_rng(4)
    return np.where(chosen.random(SHAPE) < 0.2, chosen.integers(-(2**31), 2**31, SHAPE), 0).astype(np.int32)


def test_labels_come_back_here_and_by_hdf5(label: np.ndarray) -> None:
    assert np.array_equal(unpacked_label(packed_frame(label), SHAPE), label)
    with h5py.File("any.h5", "w", driver="core", backing_store=False) as file:
        dataset = file.create_dataset("label", SHAPE, np.int32, chunks=SHAPE, compression="gzip", shuffle=True)
        dataset.id.write_direct_chunk((0, 0, 0), packed_frame(label).data)
        assert np.array_equal(dataset[()], label)


@pytest.mark.parametrize(
    "otherwise",
    [
        pytest.param(lambda label: packed_frame(np.concatenate([label, label])), id="more"),
        pytest.param(lambda label: packed_frame(label[:2]), id="fewer"),
        pytest.param(lambda label: PackedFrame(0, packed_frame(label).data[:-6]), id="cut off"),
        pytest.param(lambda label: PackedFrame(0, label.tobytes()), id="no deflate"),
        pytest.param(lambda label: PackedFrame(1, zlib.compress(label.tobytes())), id="not shuffled"),
    ],
)
def test_labels_that_were_packed_otherwise_are_refused(label: np.ndarray, otherwise: Any) -> None:
    refused(ValueError, r".+", unpacked_label, otherwise(label), SHAPE)


@pytest.fixture(scope="module")
def uu4_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder, data = tmp_path_factory.mktemp("uu4"), data_path("uu4")
    rig, run, names = folder / "rig.toml", folder / "run.h5", [f"cam{k}" for k in range(1, 5)]
    calibrations = [str(data / name / "config.xml") for name in names]
    masks = f"{data.resolve()}/{{name}}/foreground_cropped.avi"
    given = ["--size", "644,486", "--unit", "mm", "--up=-z", "--area=-2.5,-4.5,2.5,1.5", "--frame-rate", "5"]
    given += ["--source-pattern", masks, "--source-kind", "masks"]
    assert main(["calibrate", "import", "opencv", *calibrations, "-o", str(rig), *given]) == 0
    assert main(["run", str(rig), "-o", str(run), "--frames", f"0:{UU4_FRAMES}"]) == 0
    return run


def test_silx_shows_real_cameras(uu4_run: Path) -> None:
    with silx.io.open(str(uu4_run)) as file:
        shown = silx.io.nxdata.get_default(file)
        assert shown.is_valid and shown.signal_dataset_name == "log_odds"
        assert shown.signal.shape == (UU4_FRAMES, 10, 60, 50)
        assert [axis.attrs["units"] for axis in shown.axes] == ["s", "m", "m", "m"]
        np.testing.assert_allclose(shown.axes[0][()], np.arange(UU4_FRAMES) / 5)


def test_xarray_finds_people_in_the_volume(uu4_run: Path) -> None:
    """Where somebody is, the volume is for a person and has their label."""
    run = read_run(uu4_run)
    with xarray.open_dataset(uu4_run, group="entry/occupancy", engine="h5netcdf", phony_dims="access") as volume:
        assert volume.x.attrs["units"] == "m"
        np.testing.assert_allclose(volume.y[[0, -1]], [-4.45, 1.45])
        here = run.trajectory[run.trajectory["frame"] == 12]
        assert len(here) == 4
        for row in here:
            cell = volume.sel(time=12 / 5, plane=0.8, x=row["raw_x"], y=row["raw_y"], method="nearest")
            assert (int(cell.label), float(cell.log_odds) > 0) == (row["id"], True)


def test_pedpy_measures_how_they_walk(uu4_run: Path) -> None:
    data = pedpy.load_trajectory_from_ped_data_archive_hdf5(trajectory_file=uu4_run)
    area = pedpy.load_walkable_area_from_ped_data_archive_hdf5(trajectory_file=uu4_run)
    assert (data.frame_rate, area.area) == (5.0, pytest.approx(30.0))
    assert data.data.groupby("frame").size().tolist() == [4] * UU4_FRAMES
    speed = pedpy.compute_individual_speed(
        traj_data=data, frame_step=2, speed_calculation=pedpy.SpeedCalculation.BORDER_SINGLE_SIDED
    )
    assert 0.2 < speed["speed"].median() < 2.5  # metres per second: they walk
