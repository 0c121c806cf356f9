"""A run file as layers of napari: the volume, the labels, the tracks. `stseg/napari.yaml` registers it."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from stseg.io.runfile import layout
from stseg.io.runfile.reading.hdf5_reading import read_attribute
from stseg.io.runfile.reading.run_reader import Run, read_run
from stseg.io.untrusted.safe_hdf5 import hdf5_file, open_hdf5

Layer = tuple[Any, dict[str, Any], str]
"""Data, what the layer's constructor is given, kind of layer: napari's LayerData."""

_UNITS = ("s", "m", "m", "m")


def get_reader(path: str | list[str]) -> Callable[[str], list[Layer]] | None:
    """The reader of a path that is dropped on napari; None unless it is a single run file that can be opened."""
    if not isinstance(path, str) or not h5py.is_hdf5(path):
        return None
    try:
        with open_hdf5(Path(path)) as file:
            ours = "format" in file.attrs and read_attribute(file, "format") == layout.FORMAT
            return read_layers if ours else None
    except (OSError, ValueError):
        return None


def read_layers(path: str) -> list[Layer]:
    """Layers of a run file, with time in seconds and lengths in metres.

    The volume and the labels stay in the file; napari reads the frames that it shows.

    FormatError where the run file is broken.

    Returns
    -------
    list of (data, arguments, kind)
        image `log_odds` float32 (time, plane, y, x), labels `label` int32 (time, plane, y, x), and tracks float64
        (n, 5): id, index of the frame, height of the place (0), y, x in metres.
    """
    run = read_run(path)
    group = hdf5_file(path, "r")[layout.OCCUPANCY]  # checked by `read_run`; open as long as napari holds the arrays
    cells = {"scale": _scale(run), "translate": _first_cell(run), **_axes()}
    volume: Layer = (
        group[layout.LOG_ODDS.name],
        {"name": "log-odds (nats)", "contrast_limits": _contrast(run), "colormap": "inferno", **cells},
        "image",
    )
    label: Layer = (group[layout.LABEL.name], {"name": "tracks' cells", "opacity": 0.6, **cells}, "labels")
    return [volume, label, *_tracks(run)]


def _tracks(run: Run) -> list[Layer]:
    """One layer; none for a run without tracks, which napari refuses."""
    table = run.trajectory[np.lexsort((run.trajectory["frame"], run.trajectory["id"]))]
    if not len(table):
        return []
    time = np.searchsorted(run.frames, table["frame"])
    data = np.stack([table["id"], time, table["z"], table["y"], table["x"]], -1).astype(float)
    features = {name: table[name].astype(float) for name in ("id", "score", "height")}
    scale, translate = (_scale(run)[0], 1.0, 1.0, 1.0), (_first_cell(run)[0], 0.0, 0.0, 0.0)
    return [
        (data, {"name": "tracks", "features": features, "scale": scale, "translate": translate, **_axes()}, "tracks")
    ]


def _axes() -> dict[str, Any]:
    return {"axis_labels": layout.AXES, "units": _UNITS}


def _scale(run: Run) -> tuple[float, ...]:
    """Seconds a frame and metres a cell: mean distances of neighbours, 1 where there are none."""
    axes = (run.frames / run.frame_rate, run.heights, run.ground_y, run.ground_x)
    return tuple(float(axis[-1] - axis[0]) / (len(axis) - 1) if len(axis) > 1 else 1.0 for axis in axes)


def _first_cell(run: Run) -> tuple[float, ...]:
    """Centre of the first cell of the first frame, seconds and metres."""
    axes = (run.frames / run.frame_rate, run.heights, run.ground_y, run.ground_x)
    return tuple(float(axis[0]) if len(axis) else 0.0 for axis in axes)


def _contrast(run: Run) -> tuple[float, float]:
    """From 0 (even odds) to the maximum of the middle frame, nats."""
    if not len(run.frames):
        return 0.0, 1.0
    log_odds, _ = run.read_frame(int(run.frames[len(run.frames) // 2]))
    return 0.0, max(1.0, float(np.max(log_odds, initial=0.0, where=np.isfinite(log_odds))))
