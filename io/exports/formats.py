"""All formats that tracks are written in; docs/file-formats.md tells what each holds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from stseg.io.exports import benchmarks, geographic, movement, pedestrians, tables
from stseg.io.runfile.run_reader import Run

FORMATS: Mapping[str, Callable[[Path, Run], None]] = {
    "csv": tables.write_csv,
    "parquet": tables.write_parquet,
    "mot": benchmarks.write_mot,
    "mot-boxes": benchmarks.write_mot_boxes,
    "wildtrack": benchmarks.write_wildtrack,
    "pedpy": pedestrians.write_pedpy,
    "jupedsim": pedestrians.write_jupedsim,
    "movement": movement.write_movement,
    "movement-boxes": movement.write_movement_boxes,
    "mf-json": geographic.write_moving_features,
    "geojson": geographic.write_geojson_lines,
    "napari": tables.write_napari_tracks,
}
"""What writes a run's tracks to a path, by the name that `stseg export --to` takes."""
