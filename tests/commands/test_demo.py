"""README's first command: the demo tracks people, scores them, and leaves what it says."""

from __future__ import annotations

import io
import json
import re
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path

import pytest

from stseg.commands.main import main
from stseg.io.runfile.runs import read_run
from stseg.io.track_csv import read_tracks_csv

ROOT = Path(__file__).parents[2]
LEAST_MODA = 80.0
"""Percent at half a metre; a floor below what was measured, so that the demo shows people who are tracked."""


@dataclass(frozen=True)
class Demo:
    """A demo that was run: its folder, and what it printed."""

    folder: Path
    said: str


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Demo:
    folder = tmp_path_factory.mktemp("demo") / "shown"
    with redirect_stdout(io.StringIO()) as printed:
        assert main(["demo", str(folder)]) == 0
    return Demo(folder, printed.getvalue())


def test_people_are_tracked(demo: Demo, capsys: pytest.CaptureFixture[str]) -> None:
    truth = demo.folder / "scene" / "truth.csv"
    assert main(["evaluate", str(demo.folder / "run.h5"), str(truth), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["MODA"] >= LEAST_MODA
    run = read_run(demo.folder / "run.h5")
    assert set(run.frames) >= set(read_tracks_csv(truth)["frame"])
    assert all(source.source.kind == "video" and source.background for source in run.recording.sources)


def test_pictures_and_page_are_there(demo: Demo) -> None:
    cameras = read_run(demo.folder / "run.h5").cameras
    for name in ("plan", "spacetime", "slices", "marginal", *(f"overlay_{camera}" for camera in cameras)):
        assert (demo.folder / "pictures" / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    assert (demo.folder / "report.html").read_text("utf-8").lstrip().lower().startswith("<!doctype html>")


def test_it_scores_and_names_what_to_open(demo: Demo) -> None:
    assert re.search(r"MODA \d+\.\d %", demo.said)
    listed = re.findall(r"^  (\S+) ", demo.said.partition("\nOpen\n")[2], re.MULTILINE)
    assert str(demo.folder / "report.html") in listed
    assert all(Path(name).is_file() for name in listed)


def test_a_folder_with_files_in_it_is_left_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mine.txt").write_text("precious")
    assert main(["demo", str(tmp_path)]) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]
    assert main(["demo", str(tmp_path / "mine.txt")]) == 2
    assert (tmp_path / "mine.txt").read_text() == "precious"


def test_the_python_example_of_the_readme_runs(demo: Demo, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pandas")
    example = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text("utf-8"), re.DOTALL)
    assert len(example) == 1
    monkeypatch.chdir(demo.folder)
    names: dict[str, object] = {}
    exec(example[0], names)
    assert len(names["tracks"]) == len(read_run(demo.folder / "run.h5").trajectory)  # type: ignore[arg-type]


@pytest.mark.parametrize("model", ["chromatic", "codebook"])
def test_every_background_model_can_be_asked_for(demo: Demo, tmp_path: Path, model: str) -> None:
    rig, output = demo.folder / "scene" / "rig.toml", tmp_path / "run.h5"
    chosen = f"foreground.model={model}"
    assert main(["run", str(rig), "-o", str(output), "--frames", "0:12", "--set", chosen]) == 0
    assert len(read_run(output).trajectory) > 0
