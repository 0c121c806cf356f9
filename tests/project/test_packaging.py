"""The conda recipe and the workflows agree with pyproject.toml."""

from __future__ import annotations

import re
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
    found = re.fullmatch(r"([\w-]+)(.*)", requirement)
    assert found is not None
    name = found[1].lower()
    return f"{_CONDA_NAMES.get(name, name)} {found[2]}"


def test_the_conda_recipe_requires_what_the_wheel_does(project: dict[str, Any]) -> None:
    recipe = parsed("conda/recipe.yaml")
    assert recipe["package"] == {"name": project["name"], "version": project["version"]}
    own = [f"python {project['requires-python']}", *map(conda_form, project["dependencies"])]
    assert recipe["requirements"]["run"] == own
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
