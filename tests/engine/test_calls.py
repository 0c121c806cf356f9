"""Calls in another process, while this one goes on."""

from __future__ import annotations

import os

import numba
import pytest

from stseg.engine.offline.calls import called_beside, called_here
from stseg.errors import ConfigError
from stseg.kernels.accelerate import COMPILED


def _dies_elsewhere(process: int) -> int:
    if os.getpid() != process:
        os._exit(1)
    return 7


def _refuses() -> None:
    raise ConfigError("--frames", "", "none", "some")


def _compiles() -> int:
    return int(numba.njit(lambda: 3)())


def test_a_call_is_made_in_another_process() -> None:
    with called_beside(print, os.getpid) as result:
        assert result() != os.getpid()


def test_a_call_whose_process_dies_is_made_here() -> None:
    with called_beside(print, _dies_elsewhere, os.getpid()) as result:
        assert result() == 7


def test_a_call_here_is_made_once_its_result_is_asked_for() -> None:
    made = list[int]()
    with called_here(made.append, 1) as result:
        assert not made
        result()
    assert made == [1]


def test_an_error_passes_from_the_other_process() -> None:
    with called_beside(print, _refuses) as result, pytest.raises(ConfigError, match="--frames"):
        result()


@pytest.mark.skipif(not COMPILED, reason="kernels are not compiled")
def test_what_the_other_process_compiles_is_noted() -> None:
    notes = list[str]()
    with called_beside(notes.append, _compiles) as result:
        assert result() == 3
    assert notes == ["compiling kernels, once on this machine, about a minute of work"]
