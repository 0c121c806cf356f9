"""How tests of all rooms get their cases and data, draw values and meet refusals."""

import os
import tomllib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stseg.kernels.accelerate import COMPILED

P = ParamSpec("P")
Test = TypeVar("Test", bound=Callable[..., None])
Command = Callable[..., str]
"""Calls a command with arguments of any kind; its answer."""
Captured = pytest.CaptureFixture[str]
"""What a test has printed."""
REFUSAL_TIME = 10.0
"""Time within which any input is answered, seconds."""
compiled_only = pytest.mark.skipif(not COMPILED, reason="too slow without a compiler")
"""A test that is too slow as plain Python; each line of its kernels runs in another one, too."""


def refused(kind: type[Exception], match: str, call: Callable[P, object], *args: P.args, **kwargs: P.kwargs) -> str:
    """The message of the error that a call raises, of a kind and like a regular expression."""
    with pytest.raises(kind, match=match) as caught:
        call(*args, **kwargs)
    return str(caught.value)


@cache
def tables(path: Path) -> dict[str, Any]:
    """What stands in a TOML file."""
    return tomllib.loads(path.read_text("utf-8"))


def frozen(value: Any) -> Any:
    """Lists of a table as tuples."""
    return tuple(map(frozen, value)) if isinstance(value, list) else value


def cases(*more: object) -> Callable[[Test], Test]:
    """A test of each row of the table of its name, of rows that code makes, and in CI of the table NAME_in_ci.

    The first row of a table names the columns.
    """

    def parametrised(test: Test) -> Test:
        name, given = test.__name__[5:], tables(Path(test.__code__.co_filename).with_suffix(".toml"))
        (columns, *rows), late = given[name], in_ci(*map(tuple, given.get(f"{name}_in_ci", ())))
        return cast(Test, pytest.mark.parametrize(columns, [*rows, *more, *late])(test))

    return parametrised


def examples(number: int) -> int:
    """Number of examples of a property: a third, all with STSEG_ALL_EXAMPLES, a fifth with kernels as plain Python."""
    return -(-number // (5 if not COMPILED else 1 if "STSEG_ALL_EXAMPLES" in os.environ else 3))


def drawn(
    number: int, *strategies: st.SearchStrategy[Any], **named: st.SearchStrategy[Any]
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """A property of drawn values, as many as examples() makes of a number."""

    def tested(test: Callable[..., None]) -> Callable[..., None]:
        return settings(max_examples=examples(number))(given(*strategies, **named)(test))

    return tested


def numbers(low: float, high: float) -> st.SearchStrategy[float]:
    """Finite floats, bounds included."""
    return st.floats(low, high, allow_nan=False, allow_infinity=False)


def data_path(name: str) -> Path:
    """A data set, or a file of one; the test is skipped where it is not here."""
    path = Path(os.environ.get("STSEG_DATA", Path(__file__).parents[1] / "../shared/data")) / name
    if not path.exists():
        pytest.skip(f"{name} is not here: set STSEG_DATA to the folder of the data sets")
    return path


def in_ci(*cases: object) -> list[object]:
    """Cases of a parametrised test that CI runs, and plain pytest does not: others show the same in less time."""
    return [pytest.param(*(case if isinstance(case, tuple) else (case,)), marks=pytest.mark.slow) for case in cases]
