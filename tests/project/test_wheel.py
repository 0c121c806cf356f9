"""Contents of the wheel: every module, also those of io/ where the link stseg/io is a plain file."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
_BUILD = "import sys; from setuptools.build_meta import build_wheel; build_wheel(sys.argv[1])"
_IMPORT = "import stseg.io.runfile.runs, stseg.io.calibrations.opencv_xml, stseg.engine.pipeline; print(stseg.__file__)"


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
    assert {"stseg/io/track_csv.py", "stseg/io/calibrations/opencv_xml.py"} <= behind_the_link
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
