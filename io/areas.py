"""Zones and lines from GeoJSON in the ground's metres."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from stseg.arrays import Floats
from stseg.errors import FormatError
from stseg.io.bounded_files import parse_json, read_text

Named = tuple[str, tuple[Floats, ...]]
"""A feature's name and its rings or lines, float64 (k, 2) each."""


def read_polygons(path: Path) -> list[Named]:
    """Polygons of a GeoJSON file: name, and rings in metres."""
    return [
        (name, tuple(_points(path, name, ring, 3)[:-1] for polygon in polygons for ring in polygon))
        for name, polygons in _features(path, {"Polygon": lambda c: [c], "MultiPolygon": list}, "zone")
    ]


def read_lines(path: Path) -> list[Named]:
    """Lines of a GeoJSON file: name, and points in metres."""
    return [
        (name, tuple(_points(path, name, line, 2) for line in lines))
        for name, lines in _features(path, {"LineString": lambda c: [c]}, "line")
    ]


def _features(path: Path, kinds: dict[str, Callable[[Any], Any]], noun: str) -> list[tuple[str, Any]]:
    """Name and coordinates of each feature of some kinds; others are passed over."""
    try:
        data: Any = parse_json(read_text(path))
    except OSError as error:
        raise FormatError(path, "", error.strerror or error, "a GeoJSON file") from error
    except ValueError as error:
        raise FormatError(path, "", f"no JSON ({error})"[:100], "GeoJSON") from error
    features = data.get("features", [data]) if isinstance(data, dict) else []
    found = []
    for index, feature in enumerate(features):
        shape = feature.get("geometry", feature) if isinstance(feature, dict) else {}
        if isinstance(shape, dict) and shape.get("type") in kinds:
            properties = feature.get("properties") or {}
            name = str(properties.get("name", feature.get("id", f"{noun} {index + 1}")))
            found.append((name, kinds[str(shape["type"])](shape.get("coordinates"))))
    if not found:
        raise FormatError(path, "", f"no {' or '.join(kinds)}", f"GeoJSON with a feature a {noun}, in metres")
    names = [name for name, _ in found]
    if len(set(names)) < len(names):
        raise FormatError(path, "name", f"{max(names, key=names.count)!r} twice", f"a name of its own for each {noun}")
    return found


def _points(path: Path, name: str, points: Any, least: int) -> Floats:
    try:
        array = np.array([point[:2] for point in points], float)
    except (TypeError, ValueError) as error:
        raise FormatError(path, name, "coordinates that are no points", "[x, y] in metres") from error
    if array.ndim != 2 or len(array) < least or not np.isfinite(array).all():
        raise FormatError(path, name, f"{len(array)} points", f"{least} or more, all finite")
    return array
