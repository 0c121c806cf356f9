"""Tables of cases that stand as data beside their tests: `test_x.toml` beside `test_x.py`."""

import tomllib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import pytest

Test = TypeVar("Test", bound=Callable[..., None])


@cache
def tables(path: Path) -> dict[str, Any]:
    """What stands in a TOML file."""
    return tomllib.loads(path.read_text("utf-8"))


def frozen(value: Any) -> Any:
    """Lists of a table as tuples."""
    return tuple(map(frozen, value)) if isinstance(value, list) else value


def cases(*more: object) -> Callable[[Test], Test]:
    """A test of each row of the table of its name, whose first row names the columns, and of rows that code makes."""

    def parametrised(test: Test) -> Test:
        columns, *rows = tables(Path(test.__code__.co_filename).with_suffix(".toml"))[test.__name__[5:]]
        return cast(Test, pytest.mark.parametrize(columns, [*rows, *more])(test))

    return parametrised
