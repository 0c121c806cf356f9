"""Zones and lines from GeoJSON in the ground's metres."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from stseg.arrays import Floats
from stseg.errors import FormatError
from stseg.io.untrusted import limits
from stseg.io.untrusted.bounded_files import parse_json, read_text
from stseg.io.untrusted.values import EXPECTED_TITLE, abbreviated, finite_number, is_title

Named = tuple[str, tuple[Floats, ...]]
"""A feature's name and its rings or lines, float64 (k, 2) each."""


def read_polygons(path: Path) -> list[Named]:
    """Polygons of a GeoJSON file: name, and rings in metres."""
    kinds = {"Polygon": lambda rings: [rings], "MultiPolygon": lambda polygons: polygons}
    return [(name, tuple(_rings(path, name, parts))) for name, parts in _features(path, kinds, "zone")]


def _rings(path: Path, name: str, polygons: Any) -> Iterator[Floats]:
    corners = 0
    for polygon in _listed(path, name, polygons):
        for ring in _listed(path, name, polygon):
            points = _points(path, name, ring, 3)
            corners += len(points)
            points = points[:-1] if (points[0] == points[-1]).all() else points
            if len(points) < 3:
                raise FormatError(path, name, f"{len(points)} points", "3 or more for each ring")
            if corners > limits.CORNERS:
                raise FormatError(path, name, f"{corners} corners or more", f"at most {limits.CORNERS}")
            yield points
    if not corners:
        raise FormatError(path, name, "no ring", "lists of [x, y] in metres")


def read_lines(path: Path) -> list[Named]:
    """Lines of a GeoJSON file: name, and points in metres."""
    return [
        (name, (_points(path, name, line, 2),))
        for name, line in _features(path, {"LineString": lambda points: points}, "line")
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
    for index, feature in enumerate(features if isinstance(features, list) else []):
        shape = feature.get("geometry", feature) if isinstance(feature, dict) else {}
        if isinstance(shape, dict) and (kind := kinds.get(str(shape.get("type")))):
            found.append((_name(path, feature, f"{noun} {index + 1}"), kind(shape.get("coordinates"))))
    if not 0 < len(found) <= limits.AREAS:
        number = len(found) or "no"
        expected = f"GeoJSON with a feature a {noun}, in metres, at most {limits.AREAS}"
        raise FormatError(path, "", f"{number} {' or '.join(kinds)}", expected)
    names = [name for name, _ in found]
    if len(set(names)) < len(names):
        raise FormatError(path, "name", f"{max(names, key=names.count)!r} twice", f"a name of its own for each {noun}")
    return found


def _name(path: Path, feature: dict[str, Any], default: str) -> str:
    properties = feature.get("properties")
    given = properties.get("name") if isinstance(properties, dict) else None
    name = next((str(one) for one in (given, feature.get("id")) if isinstance(one, str | int)), default)
    if not is_title(name):
        raise FormatError(path, "name", abbreviated(name), EXPECTED_TITLE)
    return name


def _listed(path: Path, name: str, values: Any) -> list[Any]:
    """A list, of as many values as an area may have points."""
    if not isinstance(values, list):
        raise FormatError(path, name, "coordinates that are no points", "lists of [x, y] in metres")
    if len(values) > limits.CORNERS:
        raise FormatError(path, name, f"{len(values)} points", f"at most {limits.CORNERS}")
    return values


def _points(path: Path, name: str, points: Any, least: int) -> Floats:
    pairs = [_listed(path, name, point)[:2] for point in _listed(path, name, points)]
    if len(pairs) < least:
        raise FormatError(path, name, f"{len(pairs)} points", f"{least} or more, [x, y] in metres")
    numbers = [[finite_number(value, limits.METRES) for value in pair] for pair in pairs]
    if any(len(pair) != 2 or None in pair for pair in numbers):
        raise FormatError(path, name, "coordinates that are no points", f"[x, y] in metres, up to {limits.METRES:.0e}")
    return np.array(numbers, float)
