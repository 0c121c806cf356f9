"""Continuous integration covers the supported range of Python, and pre-commit runs what it runs."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))


def test_ci_runs_on_the_oldest_and_newest_supported_python() -> None:
    named = [line.rpartition(":: ")[2] for line in PROJECT["project"]["classifiers"]]
    (matrix,) = re.findall(r"python: \[(.*)\]", (ROOT / ".github" / "workflows" / "ci.yml").read_text("utf-8"))
    assert re.findall(r'"([\d.]+)"', matrix) == [named[0], named[-1]]
    assert PROJECT["project"]["requires-python"] == f">={named[0]}"


def test_ci_runs_the_slow_tests_too() -> None:
    assert "-m slow" in (ROOT / ".ci" / "run").read_text("utf-8")
    assert "not slow" in PROJECT["tool"]["pytest"]["ini_options"]["addopts"]


def test_pre_commit_runs_the_checks_of_ci() -> None:
    hooks = (ROOT / ".pre-commit-config.yaml").read_text("utf-8")
    run = (ROOT / ".ci" / "run").read_text("utf-8")
    for check in ("ruff check", "ruff format", "mypy"):
        assert f"entry: {check}" in hooks
        assert f'"$bin/{check}' in run or f'"$bin/{check.split()[0]}" {check.partition(" ")[2]}'.strip() in run
