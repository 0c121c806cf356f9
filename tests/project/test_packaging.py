"""Packages hold what they need, and the wheel runs."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
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


def test_recipe_and_workflows_are_of_what_the_wheel_requires(project: dict[str, Any]) -> None:
    recipe = parsed("conda/recipe.yaml")
    assert recipe["package"] == {"name": project["name"], "version": project["version"]}
    requirements = [f"python {project['requires-python']}", *map(conda_form, project["dependencies"])]
    assert recipe["requirements"]["run"] == requirements
    entries = [f"{name} = {target}" for name, target in project["scripts"].items()]
    assert recipe["build"]["python"]["entry_points"] == entries
    assert (ROOT / recipe["about"]["license_file"]).is_file() and recipe["about"]["license"] == project["license"]
    versions = [name.rpartition(" ")[2] for name in project["classifiers"]]
    run = parsed(".github/workflows/ci.yml")["jobs"]["run"]["strategy"]["matrix"]["python"]
    assert run == [versions[0], versions[-1]] and project["requires-python"] == f">={versions[0]}"
    steps = parsed(".github/workflows/platforms.yml")["jobs"]["wheel"]["steps"]
    assert {step["with"]["python-version"] for step in steps if "with" in step} <= set(versions)


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash")
def test_ci_names_rooms_and_tools_that_exist() -> None:
    named = re.findall(r"(?:tests|tools)/[^\s\"]+", (ROOT / ".ci" / "run").read_text("utf-8"))
    expanded = subprocess.run(["bash", "-c", f"echo {' '.join(named)}"], check=True, capture_output=True, text=True)
    paths = [ROOT / path.partition("::")[0] for path in expanded.stdout.split()]
    assert len(paths) > 10 and [path for path in paths if not path.exists()] == []


_BUILD = "import sys; from setuptools.build_meta import build_wheel; build_wheel(sys.argv[1])"
_IMPORT = "import stseg.io.runfile.runs, stseg.io.calibrations.xml_files, stseg.engine.pipeline; print(stseg.__file__)"


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built from a copy, so that no left-over of an older build gets in."""
    sources = tmp_path_factory.mktemp("sources")
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, sources)
    for name in ("stseg", "io"):
        kept = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / name, sources / name, symlinks=True, ignore=kept)
    link = sources / "stseg" / "io"
    link.unlink()
    link.write_text("../io", encoding="utf-8")  # what a checkout has where git makes no links
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run([sys.executable, "-c", _BUILD, str(folder)], cwd=sources, check=True, capture_output=True)
    return next(folder.glob("stseg-*.whl"))


def test_every_module_is_in_the_wheel(wheel: Path) -> None:
    names = {name for name in zipfile.ZipFile(wheel).namelist() if name.endswith((".py", "py.typed", ".yaml", ".js"))}
    modules = {path.relative_to(ROOT).as_posix() for path in (ROOT / "stseg").rglob("*.py")}
    behind_the_link = {f"stseg/{path.relative_to(ROOT).as_posix()}" for path in (ROOT / "io").rglob("*.py")}
    assert {"stseg/io/track_csv.py", "stseg/io/calibrations/xml_files.py"} <= behind_the_link
    scripts = {path.relative_to(ROOT).as_posix() for path in (ROOT / "stseg").rglob("*.js")}
    assert "stseg/reporting/page/page.js" in scripts
    assert names == modules | behind_the_link | scripts | {"stseg/py.typed", "stseg/napari.yaml"}


def test_the_wheel_works_away_from_its_sources(wheel: Path, tmp_path: Path) -> None:
    zipfile.ZipFile(wheel).extractall(tmp_path / "installed")
    environment = {**os.environ, "PYTHONPATH": str(tmp_path / "installed")}
    process = subprocess.run(
        [sys.executable, "-P", "-c", _IMPORT], capture_output=True, text=True, env=environment, cwd=tmp_path, check=True
    )
    assert Path(process.stdout.strip()).is_relative_to(tmp_path / "installed")
