"""The three ways to open a run file that everybody takes, on a run of real cameras: silx, xarray, PedPy."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pedpy
import pytest
import silx.io
import silx.io.nxdata
import xarray

from stseg.commands.main import main
from stseg.io.runfile.runs import read_run

DATA = Path(os.environ.get("STSEG_DATA", Path(__file__).parents[2] / "../shared/data")) / "uu4"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="the data set uu4 is not here: set STSEG_DATA to its parent")
FRAMES = 24


@pytest.fixture(scope="module")
def run_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("uu4")
    rig, run, names = folder / "rig.toml", folder / "run.h5", [f"cam{k}" for k in range(1, 5)]
    calibrations = [str(DATA / name / "config.xml") for name in names]
    masks = f"{DATA.resolve()}/{{name}}/foreground_cropped.avi"
    given = ["--size", "644,486", "--unit", "mm", "--up=-z", "--area=-2.5,-4.5,2.5,1.5", "--frame-rate", "5"]
    given += ["--source-pattern", masks, "--source-kind", "masks"]
    assert main(["calibrate", "import", "opencv", *calibrations, "-o", str(rig), *given]) == 0
    assert main(["run", str(rig), "-o", str(run), "--frames", f"0:{FRAMES}"]) == 0
    return run


def test_silx(run_path: Path) -> None:
    with silx.io.open(str(run_path)) as file:
        shown = silx.io.nxdata.get_default(file)
        assert (shown.is_valid, shown.signal_dataset_name, shown.signal.shape) == (
            True,
            "log_odds",
            (FRAMES, 10, 60, 50),
        )
        assert [axis.attrs["units"] for axis in shown.axes] == ["s", "m", "m", "m"]
        np.testing.assert_allclose(shown.axes[0][()], np.arange(FRAMES) / 5)


def test_xarray(run_path: Path) -> None:
    """Where somebody is, the volume is for a person and has their label."""
    run = read_run(run_path)
    with xarray.open_dataset(run_path, group="entry/occupancy", engine="h5netcdf", phony_dims="access") as volume:
        assert volume.x.attrs["units"] == "m"
        np.testing.assert_allclose(volume.y[[0, -1]], [-4.45, 1.45])
        here = run.trajectory[run.trajectory["frame"] == 12]
        assert len(here) == 4
        for row in here:
            cell = volume.sel(time=12 / 5, plane=0.8, x=row["raw_x"], y=row["raw_y"], method="nearest")
            assert (int(cell.label), float(cell.log_odds) > 0) == (row["id"], True)


def test_pedpy(run_path: Path) -> None:
    data = pedpy.load_trajectory_from_ped_data_archive_hdf5(trajectory_file=run_path)
    area = pedpy.load_walkable_area_from_ped_data_archive_hdf5(trajectory_file=run_path)
    assert (data.frame_rate, area.area) == (5.0, pytest.approx(30.0))
    assert data.data.groupby("frame").size().tolist() == [4] * FRAMES
    speed = pedpy.compute_individual_speed(
        traj_data=data, frame_step=2, speed_calculation=pedpy.SpeedCalculation.BORDER_SINGLE_SIDED
    )
    assert 0.2 < speed["speed"].median() < 2.5  # metres per second: they walk
