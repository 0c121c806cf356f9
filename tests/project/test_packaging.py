"""The conda recipe and the workflows agree with pyproject.toml; the checks of CI are files that exist."""

from __future__ import annotations

import re
import shutil
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
_CONDA_NAMES = {"opencv-python-headless": "py-opencv"}
"""conda-forge's names where they are others than PyPI's in small letters."""


@pytest.fixture(scope="module")
def project() -> dict[str, Any]:
    """The table `project` of pyproject.toml."""
    table: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    return table


def parsed(name: str) -> Any:
    return pytest.importorskip("yaml").safe_load((ROOT / name).read_text("utf-8"))


def conda_form(requirement: str) -> str:
    """`Name>=1` as conda writes it: `name >=1`."""
    parts = re.fullmatch(r"([\w-]+)(.*)", requirement)
    assert parts is not None
    name = parts[1].lower()
    return f"{_CONDA_NAMES.get(name, name)} {parts[2]}"


def test_the_conda_recipe_requires_what_the_wheel_does(project: dict[str, Any]) -> None:
    recipe = parsed("conda/recipe.yaml")
    assert recipe["package"] == {"name": project["name"], "version": project["version"]}
    requirements = [f"python {project['requires-python']}", *map(conda_form, project["dependencies"])]
    assert recipe["requirements"]["run"] == requirements
    entries = [f"{name} = {target}" for name, target in project["scripts"].items()]
    assert recipe["build"]["python"]["entry_points"] == entries
    assert (ROOT / recipe["about"]["license_file"]).is_file() and recipe["about"]["license"] == project["license"]


def test_the_workflows_run_supported_versions(project: dict[str, Any]) -> None:
    versions = [name.rpartition(" ")[2] for name in project["classifiers"]]
    run = parsed(".github/workflows/ci.yml")["jobs"]["run"]["strategy"]["matrix"]["python"]
    assert run == [versions[0], versions[-1]]
    assert project["requires-python"] == f">={versions[0]}"
    steps = parsed(".github/workflows/platforms.yml")["jobs"]["wheel"]["steps"]
    assert {step["with"]["python-version"] for step in steps if "with" in step} <= set(versions)


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash")
def test_ci_names_rooms_and_tools_that_exist() -> None:
    named = re.findall(r"(?:tests|tools)/[^\s\"]+", (ROOT / ".ci" / "run").read_text("utf-8"))
    expanded = subprocess.run(["bash", "-c", f"echo {' '.join(named)}"], check=True, capture_output=True, text=True)
    paths = expanded.stdout.split()
    assert len(paths) > 10
    assert [path for path in paths if not (ROOT / path).exists()] == []
