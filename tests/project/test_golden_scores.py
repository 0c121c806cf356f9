"""Accuracy does not fall: scores of four simulated recordings against golden ones, with a stated slack.

tests/golden/scores.json holds them; `python tests/project/test_golden_scores.py` measures them and writes it anew.
"""

import json
import tempfile
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import pytest

import stseg
from stseg.commands.main import main

GOLDEN = Path(__file__).parents[1] / "golden" / "scores.json"


SLACK = {"MODA": 1.0, "IDF1": 1.0}
"""How far scores may fall below the golden ones, percent."""
RECORDINGS: dict[str, dict[str, Any]] = {
    "demo": {"scene": "demo"},
    "easy": {"scene": "easy", "seconds": 10.0, "kinds": ("video",)},
    "similar": {"scene": "similar", "seconds": 12.0, "kinds": ("video",)},
    "dense boxes": {"scene": "dense", "seconds": 6.0, "kinds": ("boxes",)},
}
"""What is filmed: arguments of `stseg.simulate`."""


def measured(scene: dict[str, Any], folder: Path) -> dict[str, float]:
    """The scores, by the command line."""
    film, run = stseg.simulate(folder / "film", **scene), folder / "run.h5"
    _command("run", film.rig_path, "-o", run, "--overwrite")
    scores = json.loads(_command("evaluate", run, film.truth_path, "--json"))
    return {name: round(scores[name], 2) for name in SLACK}


def _command(*arguments: object) -> str:
    printed = StringIO()
    with redirect_stdout(printed):
        status = main([str(argument) for argument in arguments])
    assert not status, arguments
    return printed.getvalue()


@pytest.mark.slow
@pytest.mark.parametrize("name", list(RECORDINGS)[1:])  # the demo is scored where its command is tested
def test_scores_do_not_fall(name: str, tmp_path: Path) -> None:
    golden = json.loads(GOLDEN.read_text("utf-8"))[name]
    found = measured(RECORDINGS[name], tmp_path)
    for score, slack in SLACK.items():
        assert found[score] >= golden[score] - slack, f"{score} {found[score]}, golden {golden[score]}, slack {slack}"


if __name__ == "__main__":
    table = {}
    for name, scene in RECORDINGS.items():
        with tempfile.TemporaryDirectory() as text:
            table[name] = measured(scene, Path(text))
    GOLDEN.write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")
