"""`stseg.measure`: people in zones, at lines, and over the ground."""

from pathlib import Path
from typing import Literal

from stseg.arrays import Floats
from stseg.engine.recordings import run_of
from stseg.errors import FormatError
from stseg.geometry import Grid
from stseg.io.areas import read_lines, read_polygons
from stseg.io.exports.tables import write_tables
from stseg.io.outputs.whole_files import Inputs, make_folder, write_png
from stseg.io.runfile.runs import Run
from stseg.measures.areas import Areas, Line, Zone
from stseg.measures.measure import Measures, measure_tracks
from stseg.reporting.page.html import png_bytes
from stseg.reporting.pictures.maps import flow_map


def measure(
    run: Run | Path | str,
    zones: Path | str | None = None,
    lines: Path | str | None = None,
    *,
    output: Path | str | None = None,
    format_: Literal["csv", "parquet"] = "csv",
    overwrite: bool = False,
) -> Measures:
    """Measure a run, as `stseg measure` does: zones, lines, tracks, distances, density and flow.

    Parameters
    ----------
    run
        The run, or its file.
    zones, lines
        GeoJSON files with polygons and with lines, in metres on the ground; `properties.name` names each. Without zones
        the whole ground is one.
    output
        Folder for the tables and flow.png; None to write nothing.
    format_
        Of the tables.
    overwrite
        Replace tables that exist.

    Returns
    -------
    Measures
        Structured arrays: zones, people, visits, lines, crossings, tracks, motion, spacing, field.

    Raises
    ------
    FormatError
        Where a file is no GeoJSON of such features, or one of them lies beside the ground.
    """
    found = run_of(run)
    if output is not None:
        found.require_consistency()
    rig, areas = found.recording.rig, read_areas(found, zones, lines)
    measures = measure_tracks(found.trajectory, found.frames, found.frame_rate, rig.grid, areas)
    if output is not None:
        folder = Path(output)
        make_folder(folder)
        inputs = Inputs(found.files, [None if one is None else Path(one) for one in (zones, lines)])
        write_tables(folder, measures.tables(), format_, overwrite, inputs)
        drawn_zones = [(zone.name, zone.rings) for zone in areas.zones]
        drawn_lines = [(line.name, line.points) for line in areas.lines]
        flow = png_bytes(flow_map(rig, measures.field, drawn_zones, drawn_lines))
        write_png(folder / "flow.png", flow, overwrite, inputs)
    return measures


def read_areas(run: Run, zones: Path | str | None, lines: Path | str | None) -> Areas:
    """Zones and lines from files; without a file of zones, the whole ground."""
    named = [] if zones is None else [Zone(name, rings) for name, rings in read_polygons(Path(zones))]
    drawn = [] if lines is None else [Line(name, points) for name, (points,) in read_lines(Path(lines))]
    grid = run.recording.rig.grid
    for file, shapes in (
        (zones, [("zone", zone.name, zone.rings[0]) for zone in named]),
        (lines, [("line", line.name, line.points) for line in drawn]),
    ):
        for noun, name, points in shapes:
            _require_on_ground(Path(file or ""), f"{noun} {name}", points, grid)
    for zone in named:
        _require_area(Path(zones or ""), zone, grid)
    return Areas(tuple(named) or (Zone("ground", (grid.corners,)),), tuple(drawn))


def _require_on_ground(file: Path, place: str, points: Floats, grid: Grid) -> None:
    """Refuse points (n, 2) that lie beside the ground rectangle, all of them on one side."""
    low, high = points.min(axis=0), points.max(axis=0)
    if any(high[k] < side[0] or low[k] > side[1] for k, side in enumerate((grid.x, grid.y))):
        found = f"x {low[0]:g} to {high[0]:g}, y {low[1]:g} to {high[1]:g}"
        ground = f"x {grid.x[0]:g} to {grid.x[1]:g}, y {grid.y[0]:g} to {grid.y[1]:g}"
        raise FormatError(file, place, found, f"metres on the ground, which is {ground}")


def _require_area(file: Path, zone: Zone, grid: Grid) -> None:
    """Refuse a zone that intersects itself, or holds none of the ground on which people are tracked."""
    if zone.fault is not None:
        raise FormatError(file, f"zone {zone.name}", zone.fault, "rings that do not intersect themselves")
    if zone.area_on(grid) == 0:
        raise FormatError(file, f"zone {zone.name}", "no ground within the rig's area", "a part of it")
