"""Hostile options, tables and terminals (findings F5, F12, F15, F16 and F18)."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from attacks import refusal, write_rig
from run_files import write_small_run

from stseg.kernels.accelerate import COMPILED, kernel
from stseg.kernels.cache import KernelFolder


@pytest.fixture
def run_file(tmp_path: Path) -> Path:
    (tmp_path / "run").mkdir()
    return write_small_run(tmp_path / "run" / "night.h5")


@pytest.mark.parametrize(
    "frames", ["0:300000000", "0:9999999999999", "9" * 5000, "0:" + "9" * 5000, "\u0663:\u0665", "5:3"]
)
def test_ranges_of_frames_are_bounded(
    tmp_path: Path, run_file: Path, capsys: pytest.CaptureFixture[str], frames: str
) -> None:
    (tmp_path / "truth.csv").write_text("frame,id,x,y\n0,1,0,0\n")
    refusal(capsys, "evaluate", run_file, tmp_path / "truth.csv", "--frames", frames)
    refusal(capsys, "run", write_rig(tmp_path), "-o", tmp_path / "q.h5", "--frames", frames)


def test_twenty_thousand_people_in_a_frame_are_refused(
    tmp_path: Path, run_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "truth.csv").write_text("frame,id,x,y\n" + "".join(f"0,{k},0,0\n" for k in range(20_000)))
    assert "people in a frame" in refusal(capsys, "evaluate", run_file, tmp_path / "truth.csv")


@pytest.mark.parametrize(
    "option",
    [("--seconds", "nan"), ("--frame-rate", "inf"), ("--size", "100000,100000"), ("--size", "9" * 5000 + ",1")],
)
def test_simulations_are_bounded(tmp_path: Path, capsys: pytest.CaptureFixture[str], option: tuple[str, str]) -> None:
    refusal(capsys, "simulate", tmp_path / "scene", "--scene", "tiny", *option)


@pytest.mark.parametrize(
    ("shell", "status"),
    [
        ('"$0" -m stseg.commands.main --help >&-', (0, 2)),
        ('"$0" -m stseg.commands.main --help >/dev/full', (2,)),
        ('PYTHONIOENCODING=ascii "$0" -m stseg.commands.main run "Ω.toml" -o q.h5', (2,)),
    ],
)
def test_any_standard_output_will_do(tmp_path: Path, shell: str, status: tuple[int, ...]) -> None:
    program = shell.replace(
        "-m stseg.commands.main", "-c 'import sys; from stseg.commands.main import main; sys.exit(main())'"
    )
    done = subprocess.run(
        ["sh", "-c", program, sys.executable], cwd=tmp_path, capture_output=True, text=True, check=False,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])},
    )  # fmt: skip
    assert done.returncode in status, done.stderr
    assert "Traceback" not in done.stderr
    assert len(done.stderr.splitlines()) <= 1


def test_no_escape_codes_reach_the_terminal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    refusal(capsys, "run", tmp_path / "\x1b[31mred.toml", "-o", tmp_path / "q.h5")
    refusal(capsys, "run", write_rig(tmp_path, 'name = "cam1"', 'name = "\\u001b[31m"'), "-o", tmp_path / "q.h5")


@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
def test_kernels_compile_without_a_place_for_their_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(KernelFolder, "from_function", lambda function, source: None)  # noqa: ARG005
    assert kernel(_double)(2.0) == 4.0


def _double(value: float) -> float:
    return 2 * value
