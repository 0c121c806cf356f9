"""Tracks for geographic information systems: OGC Moving Features JSON, and GeoJSON by lines.

Both are of the plane: coordinates are the run's metres on the ground, not degrees.
"""

import json
import math
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from stseg.arrays import Rows
from stseg.io.exports.movement import rows_by_track
from stseg.io.outputs.whole_files import MARK
from stseg.io.runfile.reading.run_reader import Run

BEGINNING = datetime(1970, 1, 1, tzinfo=UTC)
"""Time that stands for the first frame of the recording: run files do not say at what time of day it was."""

GROUND = 'LOCAL_CS["ground of the rig",UNIT["metre",1]]'
"""A coordinate system of the place, as well-known text."""

_ISO_8601 = "urn:ogc:data:time:iso8601"


def write_moving_features(path: Path, run: Run) -> None:
    """Write OGC Moving Features JSON (19-045r3, "MF-JSON Prism"): a MovingPoint a track, with its score by time.

    Times count from 1970-01-01T00:00:00Z, which stands for the recording's first frame.
    """
    collection = {
        "type": "FeatureCollection",
        "software": MARK.decode(),
        "crs": {"type": "Name", "properties": {"name": GROUND}},
        "trs": {"type": "Name", "properties": {"name": _ISO_8601}},
        "features": [_moving_point(run, run.tracks[k], rows) for k, rows in rows_by_track(run, run.trajectory)],
    }
    with path.open("w", newline="\n", encoding="utf-8") as file:
        json.dump(collection, file, allow_nan=False)


def write_geojson_lines(path: Path, run: Run) -> None:
    """Write newline-delimited GeoJSON: a line a track, a LineString, or a Point where it has one place."""
    with path.open("w", newline="\n", encoding="utf-8") as file:
        for k, rows in rows_by_track(run, run.trajectory):
            track, places = run.tracks[k], _places(rows)
            geometry: dict[str, object] = {"type": "LineString", "coordinates": places}
            if len(places) == 1:
                geometry = {"type": "Point", "coordinates": places[0]}
            properties = {
                **_properties(run, track),
                "first": int(track["first"]),
                "last": int(track["last"]),
                "start": round(int(track["first"]) / run.frame_rate, 6),
                "duration": round(int(track["last"] - track["first"]) / run.frame_rate, 6),
            }
            feature = {"type": "Feature", "id": int(track["id"]), "geometry": geometry, "properties": properties}
            file.write(json.dumps({**feature, "software": MARK.decode()}, allow_nan=False) + "\n")


def _moving_point(run: Run, track: np.void, rows: Rows) -> dict[str, object]:
    instants = (BEGINNING + timedelta(seconds=frame / run.frame_rate) for frame in rows["frame"].tolist())
    times = [instant.isoformat(timespec="milliseconds").replace("+00:00", "Z") for instant in instants]
    score = {"type": "Measure", "values": [_finite(value) for value in rows["score"].tolist()]}
    point = {"type": "MovingPoint", "datetimes": times, "coordinates": _places(rows), "interpolation": "Linear"}
    return {
        "type": "Feature",
        "id": int(track["id"]),
        "properties": _properties(run, track),
        "time": [times[0], times[-1]],
        "temporalGeometry": point,
        "temporalProperties": [{"datetimes": times, "score": score}],
    }


def _properties(run: Run, track: np.void) -> dict[str, object]:
    identity = int(track["id"])
    named = {"name": run.names[identity]} if identity in run.names else {}
    return {"id": identity, **named, "height": _finite(float(track["height"])), "score": _finite(float(track["score"]))}


def _places(rows: Rows) -> list[list[float]]:
    """x and y of every row, metres, to 0.1 mm."""
    return [[round(x, 4), round(y, 4)] for x, y in zip(rows["x"].tolist(), rows["y"].tolist(), strict=True)]


def _finite(value: float) -> float | None:
    """Three decimals, or null: JSON has no infinity."""
    return round(value, 3) if math.isfinite(value) else None
