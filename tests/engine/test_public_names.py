"""What `import stseg` promises."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from run_files import write_small_run
from scenes import corner_cameras, rig_of

import stseg


def test_every_public_name_is_there() -> None:
    assert {*stseg.__all__, "__version__"} == set(dir(stseg))
    for name in stseg.__all__:
        assert getattr(stseg, name).__name__ == name


@pytest.fixture(scope="module")
def instances(tmp_path_factory: pytest.TempPathFactory) -> dict[str, object]:
    """One large instance of each public class."""
    rig = rig_of(corner_cameras())
    run = stseg.read_run(write_small_run(tmp_path_factory.mktemp("run") / "run.h5"))
    tracker = stseg.Tracker(rig, tracker="frames")
    corners = np.random.default_rng(0).uniform(-1, 1, (50, 2))
    boxes = stseg.Boxes(np.ones((90, 4)), np.ones(90))
    (committed,) = [*tracker.add([np.zeros((0, 4))] * 4), *tracker.finish()]
    return {
        "Boxes": boxes,
        "Camera": rig.cameras[0],
        "CommittedFrames": committed,
        "Config": stseg.Config(),
        "FrameSet": stseg.FrameSet(3, (boxes, None)),
        "Grid": stseg.Grid((-1.0, 1.0), (-1.0, 1.0), polygon=corners),
        "InputError": stseg.InputError("rig.toml", "key", 1, "2"),
        "Lens": stseg.Lens(np.eye(3), np.zeros(8)),
        "Recording": run.recording,
        "Rig": rig,
        "Run": run,
        "Scores": stseg.evaluate(run.trajectory, run.trajectory),
        "Source": run.recording.sources[0].source,
        "StsegError": stseg.StsegError("words"),
        "Tracker": tracker,
    }


@pytest.mark.parametrize("name", stseg.__all__)
def test_a_public_object_shows_itself_in_ten_lines(name: str, instances: dict[str, object]) -> None:
    public = getattr(stseg, name)
    shown = repr(instances[name] if isinstance(public, type) else public)
    assert shown.count("\n") < 10
    assert len(shown) < 600
    assert not shown.startswith("<stseg")


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="nothing_of_that_name"):
        getattr(stseg, "nothing_of_that_name")  # noqa: B009  # the checkers know that it is not there


def test_importing_the_package_imports_nothing_slow() -> None:
    code = "import sys, stseg; print(*(m for m in ('numba', 'cv2', 'h5py', 'scipy') if m in sys.modules))"
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert shown.stdout.strip() == ""


def test_the_package_is_the_command() -> None:
    shown = subprocess.run([sys.executable, "-m", "stseg", "--version"], capture_output=True, text=True, check=True)
    assert shown.stdout.strip() == stseg.__version__
