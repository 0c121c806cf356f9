"""Every code block of README and docs runs: Python as it stands, commands as far as their options go."""

from __future__ import annotations

import ast
import re
import shlex
from importlib.util import find_spec
from pathlib import Path

import pytest
from recordings import compiled_only, track, write_recording

from stseg.commands.main import _app

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
_BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)


def blocks(page: Path, language: str) -> list[str]:
    return [text for name, text in _BLOCK.findall(page.read_text("utf-8")) if name == language]


def lacking(code: str) -> set[str]:
    """Libraries that a block imports and that are not installed."""
    nodes = list(ast.walk(ast.parse(code)))
    names = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    names |= {node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)}
    return {name for name in {name.partition(".")[0] for name in names} if find_spec(name) is None}


def commands(page: Path) -> list[list[str]]:
    """The calls of stseg in a page's shell blocks, without those that stand for others."""
    found = []
    for block in blocks(page, "sh"):
        for line in block.replace("\\\n", " ").splitlines():
            tokens = shlex.split(line, comments=True)
            if tokens[:1] == ["stseg"] and not {"...", "COMMAND", "FORMAT"} & set(tokens):
                end = next((k for k, token in enumerate(tokens) if token in ("|", "&&", "&", ";", ">")), len(tokens))
                found.append(tokens[1:end])
    return found


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording and its run under the names that pages give them."""
    place = tmp_path_factory.mktemp("docs")
    assert track(write_recording(place), place / "run.h5") == 0
    (place / "RUN.h5").symlink_to(place / "run.h5")
    return place


@compiled_only
@pytest.mark.parametrize("page", [p for p in PAGES if blocks(p, "python")], ids=lambda page: page.name)
def test_python_blocks_run(page: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    monkeypatch.setenv("MPLBACKEND", "agg")
    names: dict[str, object] = {}
    for number, code in enumerate(blocks(page, "python")):
        if not lacking(code):
            exec(compile(code, f"{page.name}, block {number}", "exec"), names)


@pytest.mark.parametrize("page", [p for p in PAGES if commands(p)], ids=lambda page: page.name)
def test_commands_parse(page: Path) -> None:
    for tokens in commands(page):
        _app(tokens).parse_args(tokens, exit_on_error=False, print_error=False)
