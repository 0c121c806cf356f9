"""Flow through a line, and speed over density, from a run file.

python docs/examples/flow_and_density.py RUN.h5 [X0 Y0 X1 Y1]

The line goes from (X0, Y0) to (X1, Y1), metres on the ground; without it, across the middle of the area.
"""

from __future__ import annotations

import sys

import numpy as np
import pandas

import stseg
from stseg.arrays import Floats

SPEED_OVER = 1.0
"""Seconds between the two places that a speed is taken from: long against the sway of a step."""

DENSITY_STEP = 0.1
"""Width of a class of densities, people per square metre."""


def crossings(table: pandas.DataFrame, start: Floats, stop: Floats) -> pandas.DataFrame:
    """Who crosses the line from start to stop: time, id, and direction, 1 from its right side to its left, else -1."""
    table = table.sort_values(["id", "frame"])
    ground = table[["x", "y"]].to_numpy()
    along, (before, after) = stop - start, (ground[:-1] - start, ground[1:] - start)
    side, side_after = (along[0] * place[:, 1] - along[1] * place[:, 0] for place in (before, after))
    turned = (side >= 0) != (side_after >= 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        met = before + (side / (side - side_after))[:, None] * (after - before)
    share = met @ along / (along @ along)  # 0 at the line's start, 1 at its end
    ids = table["id"].to_numpy()
    crossed = turned & (share >= 0) & (share <= 1) & (ids[1:] == ids[:-1])
    direction = np.where(side_after >= 0, 1, -1)[crossed]
    return pandas.DataFrame(
        {"time": table["time"].to_numpy()[1:][crossed], "id": ids[1:][crossed], "direction": direction}
    )


def speeds(table: pandas.DataFrame, frame_rate: float) -> pandas.DataFrame:
    """The table with `speed`, metres per second, over SPEED_OVER around each row; rows without are left out."""
    half = max(1, round(SPEED_OVER * frame_rate / 2))
    places = table[["frame", "id", "x", "y"]]
    earlier, later = (places.assign(frame=places["frame"] + shift) for shift in (half, -half))
    joined = table.merge(earlier, on=["frame", "id"], suffixes=("", "_earlier"))
    joined = joined.merge(later, on=["frame", "id"], suffixes=("", "_later"))
    way = np.hypot(joined["x_later"] - joined["x_earlier"], joined["y_later"] - joined["y_earlier"])
    return joined[list(table.columns)].assign(speed=way * frame_rate / (2 * half))


def speed_over_density(table: pandas.DataFrame, frame_rate: float, area: float) -> pandas.DataFrame:
    """Mean speed and number of places for each class of densities, named by its middle, people per square metre."""
    density = table.groupby("frame")["id"].size().rename("density") / area
    moving = speeds(table, frame_rate).join(density, on="frame")
    middle = (np.floor(moving["density"] / DENSITY_STEP) + 0.5) * DENSITY_STEP
    return moving.groupby(middle)["speed"].agg(["mean", "size"])


def main(path: str, line: Floats | None = None) -> None:
    """Print both."""
    run = stseg.read_run(path)
    table = run.data_frame("trajectory")  # frame, id, x, y, ..., time
    grid = run.recording.rig.grid
    if line is None:
        line = np.array([grid.x[0], np.mean(grid.y), grid.x[1], np.mean(grid.y)])
    found = crossings(table, line[:2], line[2:])
    seconds = len(run.frames) / run.frame_rate
    for direction, name in ((1, "left"), (-1, "right")):
        count = int((found["direction"] == direction).sum())
        print(f"to the {name} of the line: {count} people, {count / seconds:.3f} a second")
    area = float(grid.inside().sum()) * grid.cell**2
    print(f"\ndensity 1/m2  speed m/s  places   ({area:.1f} m2)")
    for density, row in speed_over_density(table, run.frame_rate, area).iterrows():
        print(f"{density:12.2f}  {row['mean']:9.2f}  {row['size']:6.0f}")


if __name__ == "__main__":
    if len(sys.argv) not in (2, 6):
        sys.exit(__doc__)
    main(sys.argv[1], np.array(sys.argv[2:], float) if len(sys.argv) == 6 else None)
