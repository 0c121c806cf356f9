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
    """A recording, and how far its scores may fall below the golden ones.

    Attributes
    ----------
    film
        Options of `stseg simulate`.
    rig
        The rig file to run, of those that it writes.
    slack
        By score, percent. Crowds are chaotic: any change of the last bit moves them by about as much.
    """

    film: tuple[str, ...]
    rig: str
    slack: dict[str, float]


CORNERS = {
    "demo": Corner(("--scene", "demo"), "rig.toml", {"MODA": 0.5, "IDF1": 0.5}),
    "easy": Corner(("--scene", "easy", "--seconds", "10"), "rig.toml", {"MODA": 0.5, "IDF1": 0.5}),
    "similar": Corner(("--scene", "similar", "--seconds", "12"), "rig.toml", {"MODA": 1.0, "IDF1": 3.0}),
    "dense boxes": Corner(("--scene", "dense", "--seconds", "6"), "rig_boxes.toml", {"MODA": 2.0, "IDF1": 5.0}),
}


def measured(corner: Corner, folder: Path) -> dict[str, float]:
    """The scores that have a slack, by the command line."""
    film, run = folder / "film", folder / "run.h5"
    _command("simulate", film, *corner.film, "--overwrite")
    _command("run", film / corner.rig, "-o", run, "--overwrite")
    scores = json.loads(_command("evaluate", run, film / "truth.csv", "--json"))
    return {name: round(scores[name], 2) for name in corner.slack}


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
    for score, slack in CORNERS[name].slack.items():
        assert found[score] >= golden[score] - slack, f"{score} {found[score]}, golden {golden[score]}, slack {slack}"


if __name__ == "__main__":
    table = {}
    for name, corner in CORNERS.items():
        with tempfile.TemporaryDirectory() as text:
            table[name] = measured(corner, Path(text))
    GOLDEN.write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")
