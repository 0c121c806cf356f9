"""What `import stseg` promises."""

from __future__ import annotations

import subprocess
import sys

import pytest

import stseg


def test_every_public_name_is_there() -> None:
    for name in stseg.__all__:
        assert getattr(stseg, name).__name__ == name


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
