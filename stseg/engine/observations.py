"""Observations from a caller's arrays, checked against the rig's cameras."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from stseg.arrays import AnyArray, Boxes, Floats, Observation
from stseg.errors import SourceError
from stseg.geometry import Camera, Rig

Views = Sequence[Any] | Mapping[str, Any]
"""One observation per camera, in the rig's order or by the camera's name; a camera that is not named is blind."""
PEOPLE = (0,)
"""Numbers of the classes that are people, in models of the usual data sets."""

_PICTURES = {(np.dtype(kind), axes) for kind, axes in (("u1", 3), ("u1", 2), ("u2", 2), ("f4", 2), ("f8", 2))}


def in_rig_order(rig: Rig, views: Views, place: str, classes: Sequence[int] = PEOPLE) -> list[Observation]:
    """The observations of a frame set, checked; raises SourceError."""
    names = [camera.name for camera in rig.cameras]
    if isinstance(views, Mapping):
        if unknown := sorted(set(views) - set(names)):
            raise SourceError(place, "", f"a camera {unknown[0]!r}", f"some of {', '.join(names)}")
        views = [views.get(name) for name in names]
    if len(views) != len(names):
        raise SourceError(place, "", f"{len(views)} observations", f"{len(names)}, one per camera")
    return [as_observation(view, camera, place, classes) for view, camera in zip(views, rig.cameras, strict=True)]


def as_observation(view: Any, camera: Camera, place: str, classes: Sequence[int] = PEOPLE) -> Observation:
    """One observation in the form that the stages take; raises SourceError where it does not suit the camera."""
    where = f"{place}, camera {camera.name}"
    if view is None:
        return None
    if isinstance(view, Boxes):
        return as_boxes(np.column_stack([view.pixel, view.score]), where)
    detected = getattr(view, "boxes", view)  # Ultralytics' Results hold their boxes there, supervision's are Detections
    if hasattr(detected, "xyxy"):
        return as_boxes(detection_rows(detected, classes), where)
    array, shape = np.asarray(view), camera.size[::-1]
    if array.ndim == 2 and array.shape[1] in (4, 5) and array.shape != shape:
        return as_boxes(array, where)
    if (array.dtype, array.ndim) not in _PICTURES or array.shape[:2] != shape or array.shape[2:] not in ((), (3,)):
        size = f"{shape[0]} rows and {shape[1]} columns"
        expected = f"an image or mask in uint8, or a likelihood, of {size}, or boxes (n, 4 or 5)"
        raise SourceError(where, "", f"an array of {array.dtype} {array.shape}", expected)
    return as_likelihood(array, where) if array.dtype.kind == "f" else array


def detection_rows(detected: Any, classes: Sequence[int]) -> Floats:
    """Left, top, width, height, score (n, 5) of `supervision.Detections` or `ultralytics.engine.results.Boxes`.

    Of the wanted classes, or all where they have none. Boxes without an extent are left out.
    """
    corners = _as_array(detected.xyxy).reshape(-1, 4)
    score, number = (
        next((_as_array(found) for name in names if (found := getattr(detected, name, None)) is not None), None)
        for names in (("confidence", "conf"), ("class_id", "cls"))
    )
    rows = np.column_stack([corners[:, :2], corners[:, 2:] - corners[:, :2], np.ones(len(corners))])
    if score is not None:
        rows[:, 4] = score
    wanted = np.ones(len(rows), bool) if number is None else np.isin(number, classes)
    return rows[wanted & (rows[:, 2:4] > 0).all(axis=1)]


def _as_array(numbers: Any) -> Floats:
    """Numbers of NumPy, or of a tensor on any device."""
    return np.asarray(numbers.cpu() if hasattr(numbers, "cpu") else numbers, float)


def as_boxes(array: AnyArray, place: str) -> Boxes:
    """Boxes (n, 4) of left, top, width, height in pixels, or (n, 5) with a score 0..1; raises SourceError."""
    rows = np.asarray(array, float)
    pixel, score = rows[:, :4].copy(), rows[:, 4].copy() if rows.shape[1] == 5 else np.ones(len(rows))
    if not np.isfinite(rows).all():
        raise SourceError(place, "boxes", "a number that is not finite", "left, top, width, height in pixels")
    if (pixel[:, 2:] <= 0).any():
        raise SourceError(place, "boxes", f"a size of {pixel[:, 2:].min():g} pixels", "more than 0")
    if ((score < 0) | (score > 1)).any():
        raise SourceError(place, "boxes", f"a score of {score[np.abs(score - 0.5).argmax()]:g}", "0..1")
    return Boxes(pixel, score)


def as_likelihood(array: AnyArray, place: str) -> AnyArray:
    """A foreground likelihood as float32 (v, u); raises SourceError where a value leaves 0..1."""
    if not ((array >= 0) & (array <= 1)).all():
        raise SourceError(place, "likelihood", "a value outside 0..1", "probabilities of foreground")
    return np.ascontiguousarray(array, np.float32)
