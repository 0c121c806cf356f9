"""The layout of the run file: names, dtypes, axes, units and attributes of everything in it.

The writer creates this layout and the reader checks it. silx, h5web and nexpy read the NeXus attributes (NXdata:
signal, axes, interpretation), xarray the dimension scales, PedPy /trajectory with @fps and the root's @wkt_geometry.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from stseg.geometry import Grid
from stseg.records import tables

FORMAT = "stseg-run"
VERSION = 2
SUFFIXES = (".h5", ".hdf5")
"""Ends of the names of run files; other files of tracks are tables."""

OCCUPANCY = "/entry/occupancy"
PROVENANCE = "/provenance"
AXES = ("time", "plane", "y", "x")


@dataclass(frozen=True, slots=True)
class Field:
    """One array of /entry/occupancy."""

    name: str
    dtype: np.dtype[np.generic]
    axes: tuple[str, ...]
    """Names of the scales along it. Arrays with a time axis grow along it, one frame a chunk."""
    units: str
    """Empty for counts and names."""
    long_name: str
    """Label in viewers; it ends in the units."""


SCALES = (
    Field("time", np.dtype("<f8"), ("time",), "s", "time since the recording's first frame (s)"),
    Field("plane", np.dtype("<f8"), ("plane",), "m", "height above the ground (m)"),
    Field("y", np.dtype("<f8"), ("y",), "m", "y on the ground (m)"),
    Field("x", np.dtype("<f8"), ("x",), "m", "x on the ground (m)"),
)
"""The coordinates: centres of the cells."""

LOG_ODDS = Field("log_odds", np.dtype("<f4"), AXES, "nat", "log-odds of a person (nat)")
LABEL = Field("label", np.dtype("<i4"), AXES, "", "track id; 0 is background")
FRAME = Field("frame", np.dtype("<i8"), ("time",), "", "frame of the recording")
VIEWS = Field("views", np.dtype("u1"), AXES[1:], "", "number of views that see the cell")
LOG_ODDS_STEP = 1 / 32
"""Quantisation of log_odds, nats: finer digits are noise and would enlarge the file."""
FIELDS = (*SCALES, LOG_ODDS, LABEL, FRAME, VIEWS)

VolumeKind = Literal["all", "tracks", "none"]
VOLUMES = get_args(VolumeKind)
"""Values of @kept of the occupancy: the whole volume, cells near tracks, or nothing."""

ABOUT = {
    "trajectory": "one row per person and frame: metres on the ground, covariance in square metres, score in nats",
    "tracks": "one row per track: first and last frame, mean score in nats, median height and width in metres",
    "boxes": "one row per person, frame and view: pixels of the real image; view counts the cameras from 0",
    "events": "birth, death, merge, split, hand-over, doubt, return, dropped, blind, crowd; other: a track or 0",
    "ghosts": "one row per candidate and frame: status 1 true, 0 ghost; evidence in nats, parts by view",
    "windows": "one row per window: half-open ranges of frames; energy of the cut in units of energy_quantum, nats",
    "rates": "one row per window and view: error rates of the view, 0..1, and its reprojection residual, metres",
    "shifts": "every other second, image shift of each colour view since its background was learned, pixels",
    "timings": "seconds per stage and window; window -1 for work outside windows",
    "committed": "rows before identities were decided, as in trajectory; id is the filter's track",
    "committed_events": "events before identities were decided",
    "appearance": "one row per detection, frame and view that sees it apart: colours and features, a few numbers",
    "answers": "pairs of rows of /committed and how many people they show by an answer; 0 for a row that is no person",
    "known_people": "people of earlier recordings with whom those of this one were compared: mean height and colours",
}
"""Every table and its contents."""


EXCLUDED_VIEWS = "excluded_views"
"""A table of a segment's file alone, where there are any: views excluded before its first and after its last frame."""


def table_types(views: int) -> dict[str, np.dtype[np.void]]:
    """The dtype of every table of a run with so many views."""
    return {
        "trajectory": tables.TRAJECTORY,
        "tracks": tables.TRACK,
        "boxes": tables.BOX,
        "events": tables.EVENT,
        "ghosts": ghost_type(views),
        "windows": tables.WINDOW,
        "rates": tables.RATES,
        "shifts": tables.SHIFT,
        "timings": tables.TIMING,
        "committed": tables.TRAJECTORY,
        "committed_events": tables.EVENT,
        "appearance": tables.APPEARANCE,
        "answers": tables.ANSWER,
        "known_people": tables.KNOWN_PERSON,
    }


def ghost_type(views: int) -> np.dtype[np.void]:
    """CANDIDATE and `parts`, float32 (views,): evidence of each view for the candidate, nats."""
    return np.dtype([*tables.CANDIDATE.descr, ("parts", "<f4", (views,))])


ROOT_ATTRIBUTES: Mapping[str, str | int] = {
    "format": FORMAT,
    "format_version": VERSION,
    "NX_class": "NXroot",
    "default": "entry",
}
ENTRY_ATTRIBUTES: Mapping[str, object] = {"NX_class": "NXentry", "default": "occupancy"}
OCCUPANCY_ATTRIBUTES: Mapping[str, object] = {
    "NX_class": "NXdata",
    "signal": LOG_ODDS.name,
    "auxiliary_signals": [LABEL.name],
    "axes": list(AXES),
    **{f"{name}_indices": index for index, name in enumerate(AXES)},
    "frame_indices": 0,
    "default_slice": ["0", "0", ".", "."],  # h5web
    "SILX_style": '{"signal_scale_type": "linear"}',
}


def walkable_area(grid: Grid) -> str:
    """The walkable area as well-known text, metres."""
    corners = grid.corners.tolist()
    points = [f"{x!r} {y!r}" for x, y in (*corners, corners[0])]
    return f"POLYGON (({', '.join(points)}))"
