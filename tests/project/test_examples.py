"""The example of the documentation, on people who are simulated, beside PedPy."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas
import pedpy
import pytest
from checks import Captured
from run_files import small_recording, table_of, write_run

from stseg import Grid, Run, read_run
from stseg.records.tables import TRAJECTORY
from stseg.simulation import NAMED
from stseg.simulation.crowd.social_forces import walk_freely

sys.path.append(str(Path(__file__).parents[2] / "docs" / "examples"))

import flow_and_density


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Fourteen people who walk about 6 m x 6 m for ten seconds, as a tracker without faults would follow them."""
    folder, spec = tmp_path_factory.mktemp("run"), replace(NAMED["dense"], seconds=10.0)
    truth = np.concatenate([crowd.truth(spec.area) for crowd in walk_freely(spec)])
    trajectory = table_of(TRAJECTORY, **{name: truth[name] for name in ("frame", "id", "x", "y", "height")})
    recording = small_recording(folder)
    rig = replace(recording.rig, frame_rate=spec.frame_rate, grid=Grid((-3, 3), (-3, 3), 1.0, 1.8, 1))
    path, frames = folder / "run.h5", np.arange(spec.frames)
    return read_run(write_run(path, replace(recording, rig=rig), trajectory, frames))


def walked(*places: tuple[float, float]) -> pandas.DataFrame:
    """One person, a frame a second."""
    frame = np.arange(len(places))
    x, y = np.array(places).T
    return pandas.DataFrame({"frame": frame, "id": 1, "x": x, "y": y, "time": frame.astype(float)})


def test_lines_are_crossed_and_speed_is_of_a_steady_walk() -> None:
    start, stop = np.array([0.0, 0.0]), np.array([2.0, 0.0])
    there_and_back = flow_and_density.crossings(walked((1, -1), (1, 1), (1, -1)), start, stop)
    assert there_and_back[["time", "direction"]].to_numpy().tolist() == [[1, 1], [2, -1]]
    assert len(flow_and_density.crossings(walked((3, -1), (3, 1)), start, stop)) == 0
    assert len(flow_and_density.crossings(walked((1, -2), (1, -1)), start, stop)) == 0
    other = walked((1, 1), (1, 2)).assign(id=2)
    assert len(flow_and_density.crossings(pandas.concat([walked((1, -2), (1, -1)), other]), start, stop)) == 0
    table = walked(*((0.3 * step, 0.4 * step) for step in range(9)))
    found = flow_and_density.speeds(table, 1.0)
    np.testing.assert_allclose(found["speed"], 0.5)
    assert found["frame"].tolist() == list(range(1, 8))


def test_flow_speed_and_density_are_pedpy_s_and_printed(run: Run, capsys: Captured) -> None:
    table = run.data_frame("trajectory")
    found = flow_and_density.crossings(table, np.array([-3.0, 0.0]), np.array([3.0, 0.0]))
    line = pedpy.MeasurementLine([(-3, 0), (3, 0)])
    data = pedpy.load_trajectory_from_ped_data_archive_hdf5(trajectory_file=run.path)
    _, crossing = pedpy.compute_n_t(traj_data=data, measurement_line=line)
    first = (found.groupby("id")["time"].min() * run.frame_rate).round().astype(int)  # PedPy counts who crosses once
    first = first[first < run.frames[-1]]  # and not in the last frame
    assert first.to_dict() == dict(zip(crossing["id"], crossing["frame"], strict=True)) and len(first) > 3
    table = flow_and_density.speed_over_density(run.data_frame("trajectory"), run.frame_rate, 36.0)
    assert ((table["mean"] > 0) & (table["mean"] < 2)).all()
    area = pedpy.MeasurementArea([(-3, -3), (3, -3), (3, 3), (-3, 3)])
    density = pedpy.compute_classic_density(traj_data=data, measurement_area=area)["density"]
    assert table.index.min() - 0.051 <= density.min() and density.max() <= table.index.max() + 0.051
    flow_and_density.main(str(run.path))
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("to the left of the line: ")
    assert lines[3] == "density 1/m2  speed m/s  places   (36.0 m2)" and len(lines) > 4
