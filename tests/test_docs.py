"""What the documentation says of the code is so."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

from stseg.commands.main import COMMANDS
from stseg.io.recording.recording import SOURCE_KINDS
from stseg.io.recording.rigs import parse_rig
from stseg.io.runfile import layout

ROOT = Path(__file__).parents[1]
sys.path.append(str(ROOT / "tools"))

import constants_page  # noqa: E402

README = (ROOT / "README.md").read_text("utf-8")
FORMATS = (ROOT / "docs" / "file-formats.md").read_text("utf-8")


def test_the_tables_of_constants_are_those_of_the_configuration() -> None:
    page = constants_page.PAGE.read_text("utf-8")
    source = constants_page.configuration()
    assert set(re.findall(r"<!-- constants: (\w+) -->", page)) == set(constants_page.stages(source))
    assert page == constants_page.rewrite(page, source), "python tools/constants_page.py writes them anew"


def test_the_rig_file_shown_is_one() -> None:
    (text,) = re.findall(r"```toml\n(.*?)```", FORMATS, re.DOTALL)
    recording = parse_rig(text, ROOT / "room.toml")
    assert [camera.name for camera in recording.rig.cameras] == ["cam1", "cam2"]
    assert {source.source.kind for source in recording.sources} <= set(SOURCE_KINDS)
    assert all(f"| `{kind}` |" in FORMATS for kind in SOURCE_KINDS)


def test_every_array_and_column_of_the_run_file_is_told() -> None:
    for field in layout.FIELDS:
        assert re.search(rf"^ +.*\b{field.name}\b", FORMATS, re.MULTILINE)
    for name, dtype in layout.table_types(1).items():
        (row,) = re.findall(rf"^\| `/{name}`.*$", FORMATS, re.MULTILINE)
        assert set(dtype.names or ()) <= set(re.findall(r"\w+", row.partition("|")[2]))


def test_ci_runs_the_test_command_of_the_readme() -> None:
    (command,) = re.findall(r"^python3 -m venv .* (-m pytest .*)$", README, re.MULTILINE)
    assert f'"$bin/python" {command} |' in (ROOT / ".ci" / "run").read_text("utf-8")


@pytest.mark.parametrize("page", sorted(["README.md", *(f"docs/{page.name}" for page in (ROOT / "docs").glob("*.md"))]))
def test_what_a_page_names_is_there(page: str) -> None:
    text = (ROOT / page).read_text("utf-8")
    assert set(re.findall(r"(?:`|^)stseg (\w+)\b", text, re.MULTILINE)) <= {*COMMANDS, "COMMAND"}
    for link in re.findall(r"\]\((?!https?:)([^)#]+)\)", text):
        assert ((ROOT / page).parent / link).exists(), link
