"""`stseg.measure`: measures of a run file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from stseg.io.areas import read_lines, read_polygons
from stseg.io.runfile.runs import Run
from stseg.measures.areas import Areas, Line, Zone
from stseg.measures.measure import Measures, measure_tracks


def measure(run: Run, zones: Path | str | None = None, lines: Path | str | None = None) -> Measures:
    """Measure a run: zones, lines, tracks, distances, density and flow.

    Parameters
    ----------
    run
        A run, see `stseg.read_run`.
    zones, lines
        GeoJSON files with polygons and with lines, in metres on the ground; `properties.name` names each. Without zones
        the whole ground is one.

    Returns
    -------
    Measures
        Structured arrays: zones, people, visits, lines, crossings, tracks, spacing, field.

    Raises
    ------
    FormatError
        Where a file is no GeoJSON of such features.
    """
    grid = run.recording.rig.grid
    return measure_tracks(run.trajectory, run.frames, run.frame_rate, grid, read_areas(run, zones, lines))


def read_areas(run: Run, zones: Path | str | None, lines: Path | str | None) -> Areas:
    """Zones and lines from files; without a file of zones, the whole ground."""
    named = [] if zones is None else [Zone(name, rings) for name, rings in read_polygons(Path(zones))]
    drawn = [] if lines is None else [Line(name, own) for name, (own,) in read_lines(Path(lines))]
    return Areas(tuple(named) or (_whole(run),), tuple(drawn))


def _whole(run: Run) -> Zone:
    grid = run.recording.rig.grid
    (x0, x1), (y0, y1) = grid.x, grid.y
    corners = grid.polygon if grid.polygon is not None else np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
    return Zone("ground", (corners,))
