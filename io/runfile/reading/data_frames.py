"""Tables of a run file as data frames of pandas."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, cast

import numpy as np

from stseg.arrays import AnyArray, Rows
from stseg.io.extras import load_extra

if TYPE_CHECKING:
    from pandas import DataFrame


def to_data_frame(table: Rows, frame_rate: float, cameras: Sequence[str]) -> DataFrame:
    """A structured array as a data frame, with `time` (seconds) where there are frames.

    Texts become strings; a column with one value a view becomes one column a camera, `NAME_CAMERA`.

    Raises
    ------
    ConfigError
        Where pandas is not installed.
    """
    pandas = load_extra("pandas", "pandas")
    columns = dict(_columns(table, cameras))
    if "frame" in columns:
        columns["time"] = table["frame"] / frame_rate
    return cast("DataFrame", pandas.DataFrame(columns))


def _columns(table: Rows, cameras: Sequence[str]) -> Iterator[tuple[str, AnyArray]]:
    for name in table.dtype.names or ():
        column = table[name]
        if column.ndim > 1:
            yield from ((f"{name}_{camera}", column[:, view]) for view, camera in enumerate(cameras))
        elif column.dtype.kind == "S":
            yield name, np.char.decode(column, "utf-8")
        else:
            yield name, column
