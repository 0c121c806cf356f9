"""Settings of all tests, and what tests of many rooms begin with."""

import os
import signal
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as in commands: its threads wait for work by spinning

import pytest
from checks import REFUSAL_TIME, Captured, Command, examples
from hypothesis import HealthCheck, settings
from recordings import track, write_recording
from run_files import write_small_run

from stseg.commands.main import main

signal.signal(signal.SIGINT, signal.default_int_handler)  # commands inherit that it is ignored, as under `nohup`

# Examples take as long as they take on a machine that others use, too: only a whole test may be too slow. Folders of a
# test may be those of all its examples, each of which writes its files anew.
settings.register_profile(
    "timeless", max_examples=examples(100), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
settings.load_profile("timeless")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> object:
    """Each worker takes files that stand together, so that their fixtures are made once; the last are shared out."""
    from xdist.scheduler import WorkStealingScheduling  # type: ignore[import-untyped]

    return WorkStealingScheduling(config, log)


@pytest.fixture(scope="session")
def rig_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The rig file of a small recording."""
    return write_recording(tmp_path_factory.mktemp("recording"))


@pytest.fixture(scope="session")
def undisturbed(rig_path: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Its run file, made by one process without a break; nothing else is in its folder."""
    path = tmp_path_factory.mktemp("undisturbed") / "run.h5"
    assert track(rig_path, path) == 0
    return path


@pytest.fixture
def run_path(tmp_path: Path) -> Path:
    """A small run file, in a folder of its own."""
    (tmp_path / "run").mkdir()
    return write_small_run(tmp_path / "run" / "night.h5")


@pytest.fixture
def stdout(capsys: Captured) -> Command:
    """A command that ends with the status 0; its standard output."""

    def call(*arguments: object) -> str:
        capsys.readouterr()
        status = main([str(argument) for argument in arguments])
        printed = capsys.readouterr()
        assert status == 0, printed.err
        return printed.out

    return call


@pytest.fixture
def refusal(capsys: Captured) -> Command:
    """A command that refuses its input in time; its one line."""

    def call(*arguments: object) -> str:
        capsys.readouterr()
        begun = time.monotonic()
        status = main([str(argument) for argument in arguments])
        error = capsys.readouterr().err
        assert status == 2, error
        assert time.monotonic() - begun < REFUSAL_TIME
        lines = [line for line in error.splitlines() if line]
        assert len(lines) == 1, error
        assert lines[0].startswith("stseg: error: ") and lines[0].isprintable()
        return lines[0]

    return call
