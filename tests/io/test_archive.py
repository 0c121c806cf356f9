"""Databases of many runs, and completion of shells."""

from __future__ import annotations

import sqlite3
from pathlib import Path

import pytest
from run_files import write_small_run

from stseg.commands.export import export
from stseg.commands.main import completion
from stseg.errors import ConfigError

_QUESTION = (
    "SELECT r.recording, COUNT(*), MAX(t.x) FROM recordings r JOIN trajectory t USING (recording) GROUP BY 1 ORDER BY 1"
)


@pytest.fixture
def runs(tmp_path: Path) -> list[Path]:
    return [write_small_run(tmp_path / f"{name}.h5") for name in ("monday", "tuesday")]


def test_sqlite_holds_all_runs(runs: list[Path], tmp_path: Path) -> None:
    export(*runs, to="sqlite", output=tmp_path / "week.sqlite")
    connection = sqlite3.connect(tmp_path / "week.sqlite")
    assert connection.execute(_QUESTION).fetchall() == [("monday", 9, 0.3), ("tuesday", 9, 0.3)]
    assert connection.execute("SELECT COUNT(*), SUM(frames) FROM tracks").fetchone() == (4, 18)
    assert connection.execute("SELECT DISTINCT kind FROM events").fetchall() == [("birth",)]
    connection.close()


def test_duckdb_holds_all_runs(runs: list[Path], tmp_path: Path) -> None:
    duckdb = pytest.importorskip("duckdb")
    export(*runs, to="duckdb", output=tmp_path / "week.duckdb")
    with duckdb.connect(str(tmp_path / "week.duckdb"), read_only=True) as connection:
        assert connection.execute(_QUESTION).fetchall() == [("monday", 9, 0.3), ("tuesday", 9, 0.3)]


def test_many_runs_need_a_database_and_names_of_their_own(runs: list[Path], tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="2 run files, expected one, or --to sqlite or duckdb"):
        export(*runs, to="csv", output=tmp_path / "a.csv")
    with pytest.raises(ConfigError, match="monday twice"):
        export(runs[0], runs[0], to="sqlite", output=tmp_path / "a.sqlite")


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_knows_commands_and_options(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    completion(shell)  # type: ignore[arg-type]  # one of the three
    text = capsys.readouterr().out
    assert "calibrate" in text and "measure" in text and "camera-images" in text
