"""What readers of detections and calibrations refuse: the place, what was found, what was expected, in one line."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from cases import cases, tables
from refusals import refused

from stseg.errors import FormatError, InputError
from stseg.io.answers import read_answers, read_names
from stseg.io.calibrations.formats import ImportOptions, read_cameras
from stseg.io.detections.source_detections import read_source
from stseg.io.recording.recording import Source
from stseg.io.track_csv import read_tracks_csv
from stseg.io.untrusted import limits

SIZE = (80, 60)
TEXTS = tables(Path(__file__).with_suffix(".toml"))["texts"]
"""A calibration of each format."""
WILDTRACK = '[{"personID":1,"views":[{"viewNum":1,"xmin":1,"ymin":1,"xmax":2,"ymax":3}]}]'


def read(folder: Path, name: str, text: str, **keys: Any) -> object:
    """A source of one file, or of the folder that holds it."""
    (folder / name).parent.mkdir(exist_ok=True)
    (folder / name).write_text(text)
    given: dict[str, Any] = {key: tuple(value) if isinstance(value, list) else value for key, value in keys.items()}
    return read_source(Source("boxes", folder / name.split("/")[0], **given), SIZE)


@cases()
def test_unknown_json_is_named(tmp_path: Path, name: str, texts: list[str]) -> None:
    for text in texts:
        refused(InputError, "found JSON of no known detections, expected one of Ultral", read, tmp_path, name, text)


@cases(("x.json", f'[[{{"box":{{"x1":1}},"segments":{{"x":[1{"0" * 400}],"y":[1]}}}}]]', {}, "detection 0: found x"))
def test_detections_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, text: str, keys: dict[str, Any], message: str
) -> None:
    monkeypatch.setattr(limits, "BOXES_PER_FRAME", 1)
    monkeypatch.setattr(limits, "ROWS", 2)
    keys = keys | ({"image_list": tmp_path / name} if "image_list" in keys else {})
    assert "\n" not in refused(InputError, message, read, tmp_path, name, text, **keys)


@cases(("krt", "c.json", "", "[" * 100_000, "what is not JSON"))
def test_calibrations_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, format: str, name: str, old: str, new: str, message: str
) -> None:
    if format == "kalibr":
        pytest.importorskip("yaml")
    monkeypatch.setattr(limits, "CAMERAS", 2)
    (tmp_path / name).write_text(TEXTS[format].replace(old, new) if old else new)
    said = refused(InputError, message, read_cameras, format, [tmp_path / name], ImportOptions(SIZE, "m", 1.8))
    assert "\n" not in said and f"{name}: " in said


@pytest.mark.parametrize(("size", "unit", "missing"), [(None, "m", "--size"), (SIZE, None, "--unit")])
def test_homographies_of_pom_need_size_and_unit(size: Any, unit: str | None, missing: str) -> None:
    refused(InputError, f"{missing}: found nothing", read_cameras, "pom", [], ImportOptions(size, unit, 1.8))


READERS: dict[str, Callable[[Path], object]] = {
    "answers": partial(read_answers, actions=("split", "swap")), "names": read_names, "tracks": read_tracks_csv,
}  # fmt: skip


@cases()
def test_tables_are_refused(tmp_path: Path, reader: str, text: str, message: str) -> None:
    (tmp_path / "t.csv").write_text(text)
    assert "\n" not in refused(FormatError, f"t.csv: {message}", READERS[reader], tmp_path / "t.csv")
