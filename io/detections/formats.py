"""The formats of detections: recognised by content; a new one is a reader and an entry here."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from stseg.errors import FormatError, SourceError
from stseg.io.detections import annotation_tools, json_formats, tables, yolo
from stseg.io.detections.record import Detections, Request, read_json
from stseg.io.recording.source_files import numeric_order
from stseg.io.untrusted import limits
from stseg.io.untrusted.bounded_files import require_regular

JSON_FORMATS: tuple[tuple[str, Callable[[Any], bool], Callable[[Request, Any], Detections]], ...] = (
    ("COCO results", json_formats.is_coco_results, json_formats.read_coco_results),
    ("COCO data set", json_formats.is_dataset, json_formats.read_dataset),
    ("MMDetection", json_formats.is_mmdetection, json_formats.read_mmdetection),
    ("Ultralytics JSON", yolo.is_ultralytics_results, yolo.read_ultralytics_results),
    ("Label Studio", annotation_tools.is_label_studio, annotation_tools.read_label_studio),
    ("VIA", annotation_tools.is_via, annotation_tools.read_via),
    ("JSON table", tables.is_json_table, tables.read_json_table),
)
"""Name of each format of JSON, whether parsed JSON is of it, and its reader."""
NAMES = (
    "Ultralytics text",
    "WILDTRACK",
    *(one for one, *_ in JSON_FORMATS),
    "CVAT XML",
    "Parquet",
    "CSV",
    "MOTChallenge",
)
"""All formats, for messages."""


def read_detections(request: Request) -> tuple[str, Detections] | None:
    """Recognise a file or folder by its content and read it; None for the plain text forms of `read_boxes`.

    SourceError, FormatError where it cannot be read or is of no known format; names the place.
    """
    path = request.path
    with _of_form(path, "detections"):
        return _read(request, path)


@contextmanager
def _of_form(path: Path, name: str) -> Iterator[None]:
    """Raise what a value of another type than its format has comes to as FormatError."""
    try:
        yield
    except OSError as error:
        raise SourceError(path, "", error.strerror or error, "detections") from error
    except (TypeError, LookupError, AttributeError, ValueError, ArithmeticError, RecursionError) as error:
        found = f"a value of another type or size ({str(error)[:80]})"
        raise FormatError(path, "", found, f"{name}, as its format has it") from error


def _read(request: Request, path: Path) -> tuple[str, Detections] | None:
    if path.is_dir():
        return _read_folder(request)
    require_regular(path)
    suffix = path.suffix.lower()
    with path.open("rb") as file:
        beginning = file.read(64).lstrip(b"\xef\xbb\xbf \t\r\n")[:1]
    if beginning in (b"{", b"[") or suffix in (".json", ".jsonl", ".ndjson"):
        return _read_json(request, read_json(path))
    if beginning == b"<" or suffix == ".xml":
        return "CVAT XML", annotation_tools.read_cvat(request)
    if suffix == ".parquet":
        return "Parquet", tables.read_parquet(request)
    if request.source.columns or _needs_mapping(path):
        return "CSV", tables.read_csv(request)
    if tables.is_ground_truth(path):
        return "MOTChallenge truth", tables.read_ground_truth(request)
    return None


def _read_json(request: Request, data: Any) -> tuple[str, Detections]:
    for name, recognises, read in JSON_FORMATS:
        if recognises(data):
            with _of_form(request.path, name):
                return name, read(request, data)
    raise FormatError(request.path, "", "JSON of no known detections", f"one of {', '.join(NAMES)}")


def _read_folder(request: Request) -> tuple[str, Detections]:
    texts, files = yolo.text_files(request.path), sorted(request.path.glob("*.json"), key=numeric_order)
    if texts and not files:
        return "Ultralytics text", yolo.read_text_folder(request)
    if not files:
        raise SourceError(request.path, "", "a folder without text or JSON files", "detections, one file a frame")
    data = [read_json(path) for path in files]
    if any(map(json_formats.is_wildtrack, data)):
        return "WILDTRACK", json_formats.read_wildtrack(request, files, data)
    if all(map(json_formats.is_prediction, data)):
        return "MMDetection", json_formats.read_mmdetection(request, data)
    if all(map(yolo.is_frame_of_results, data)):
        return "Ultralytics JSON", yolo.read_ultralytics_results(request, data)
    wrong = next((k for k, one in enumerate(data) if not json_formats.is_prediction(one)), 0)
    raise FormatError(files[wrong], "", "JSON of no known detections", f"one of {', '.join(NAMES)}")


def _needs_mapping(path: Path) -> bool:
    """Whether a text file has a header with columns of other names than `read_boxes` reads, or with classes."""
    try:
        with path.open(encoding="utf-8-sig") as lines:
            header = [word.strip() for word in lines.readline(limits.LINE).split(",")]
    except (OSError, UnicodeDecodeError):
        return False
    lower = {name.lower() for name in header}
    if len(header) < 5 or not any(name.isidentifier() for name in lower):
        return False
    return not {"frame", "left", "top", "width", "height"} <= lower or bool(lower & tables.CLASS_NAMES)
