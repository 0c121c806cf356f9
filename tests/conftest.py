"""Settings of all tests."""

from pathlib import Path

import pytest
from hypothesis import settings
from recordings import track, write_recording

# Examples take as long as they take on a machine that others use, too: only a whole test may be too slow.
settings.register_profile("timeless", deadline=None)
settings.load_profile("timeless")


@pytest.fixture(scope="module")
def rig_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The rig file of a small recording."""
    return write_recording(tmp_path_factory.mktemp("recording"))


@pytest.fixture(scope="module")
def undisturbed(rig_path: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Its run file, made by one process without a break; nothing else is in its folder."""
    path = tmp_path_factory.mktemp("undisturbed") / "run.h5"
    assert track(rig_path, path) == 0
    return path
