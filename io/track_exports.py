"""Tracks in the text formats of other programs."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from stseg.arrays import Rows


def write_pedpy(path: Path, trajectory: Rows, frame_rate: float) -> None:
    """Write a TRAJECTORY table as PedPy and JuPedSim read it: id, frame, x, y, z, metres, in the order of ids.

    PedPy takes the first number of the line with `framerate` for the rate and the units from `x/m`, so that these two
    comments say nothing else.
    """
    rate = np.format_float_positional(frame_rate, min_digits=2)
    table = trajectory[np.lexsort((trajectory["frame"], trajectory["id"]))]
    with path.open("w", newline="\n", encoding="utf-8") as file:
        file.write(f"# framerate: {rate}\n# id frame x/m y/m z/m\n")
        np.savetxt(file, table[["id", "frame", "x", "y", "z"]], fmt="%d %d %.4f %.4f %.4f")


def write_mot(path: Path, trajectory: Rows) -> None:
    """Write a TRAJECTORY table as 3-D MOTChallenge lines: frame, id, -1, -1, -1, -1, 1, x, y, z.

    Frames count from 1 there; places are metres, and -1 stands for the box that a place on the ground has not.
    """
    columns = [trajectory[name] for name in ("x", "y", "z")]
    with path.open("w", newline="\n", encoding="utf-8") as file:
        for frame, number, x, y, z in zip(trajectory["frame"] + 1, trajectory["id"], *columns, strict=True):
            file.write(f"{frame},{number},-1,-1,-1,-1,1,{x:.4f},{y:.4f},{z:.4f}\n")
