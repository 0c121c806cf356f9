"""`stseg plan`: what it says before a run."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from recordings import FRAMES, OPTIONS, compiled_only, track, write_recording

from stseg.commands.main import main
from stseg.tasks.forecast import Forecast

pytestmark = compiled_only


@pytest.fixture(scope="module")
def rig_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_recording(tmp_path_factory.mktemp("recording"))


def test_the_file_becomes_as_large_as_planned(
    rig_path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["plan", str(rig_path), *OPTIONS, "--workers", "1", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["frames"], told["segments"], told["workers"]) == (FRAMES, 6, 1)
    assert told["seconds"] == pytest.approx(sum(told[k] for k in ("counting", "learning", "tracking", "joining")))
    assert min(told["tracking"], told["joining"]) > 0
    assert track(rig_path, tmp_path / "run.h5") == 0
    assert told["file_bytes"] == pytest.approx((tmp_path / "run.h5").stat().st_size, rel=0.25)


def test_it_is_told_in_words(rig_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", str(rig_path), *OPTIONS, "--frames", "0:20", "--workers", "3"]) == 0
    told = capsys.readouterr().out
    assert "20 frames" in told
    assert "3 workers" in told
    assert "MiB an hour" in told


def test_workers_share_the_segments() -> None:
    def seconds(workers: int) -> float:
        return Forecast(1000, 5, workers, 1.0, 2.0, 8.0, 3.0, 1).seconds

    assert [seconds(k) for k in (1, 2, 3, 5, 9)] == pytest.approx([14.0, 10.0, 8.0, 6.0, 6.0])


def test_a_part_that_is_none_is_refused(rig_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", str(rig_path), "--frames", "10:400"]) == 2
    assert "--frames: found '10:400', expected a part of the recording's frames, 0:40" in capsys.readouterr().err
