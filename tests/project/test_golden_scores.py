"""Accuracy does not fall: scores of four simulated recordings against golden ones, with a stated slack.

tests/golden/scores.json holds them; `python tests/project/test_golden_scores.py` measures them and writes it anew.
"""

from __future__ import annotations

import json
import tempfile
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

import pytest

from stseg.commands.main import main as stseg

GOLDEN = Path(__file__).parents[1] / "golden" / "scores.json"


@dataclass(frozen=True)
class Corner:
    """A recording.

    Attributes
    ----------
    film
        Options of `stseg simulate`.
    rig
        The rig file to run, of those that it writes.
    """

    film: tuple[str, ...]
    rig: str


SLACK = {"MODA": 1.0, "IDF1": 1.0}
"""How far scores may fall below the golden ones, percent."""
CORNERS = {
    "demo": Corner(("--scene", "demo"), "rig.toml"),
    "easy": Corner(("--scene", "easy", "--seconds", "10"), "rig.toml"),
    "similar": Corner(("--scene", "similar", "--seconds", "12"), "rig.toml"),
    "dense boxes": Corner(("--scene", "dense", "--seconds", "6"), "rig_boxes.toml"),
}


def measured(corner: Corner, folder: Path) -> dict[str, float]:
    """The scores, by the command line."""
    film, run = folder / "film", folder / "run.h5"
    _command("simulate", film, *corner.film, "--overwrite")
    _command("run", film / corner.rig, "-o", run, "--overwrite")
    scores = json.loads(_command("evaluate", run, film / "truth.csv", "--json"))
    return {name: round(scores[name], 2) for name in SLACK}


def _command(*arguments: object) -> str:
    printed = StringIO()
    with redirect_stdout(printed):
        status = stseg([str(argument) for argument in arguments])
    assert not status, arguments
    return printed.getvalue()


@pytest.mark.slow
@pytest.mark.parametrize("name", CORNERS)
def test_scores_do_not_fall(name: str, tmp_path: Path) -> None:
    golden = json.loads(GOLDEN.read_text("utf-8"))[name]
    found = measured(CORNERS[name], tmp_path)
    for score, slack in SLACK.items():
        assert found[score] >= golden[score] - slack, f"{score} {found[score]}, golden {golden[score]}, slack {slack}"


if __name__ == "__main__":
    table = {}
    for name, corner in CORNERS.items():
        with tempfile.TemporaryDirectory() as text:
            table[name] = measured(corner, Path(text))
    GOLDEN.write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")
