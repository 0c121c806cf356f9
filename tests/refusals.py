"""Calls that must be refused with a message."""

from collections.abc import Callable
from typing import ParamSpec

import pytest

P = ParamSpec("P")
Command = Callable[..., str]
"""Calls a command with arguments of any kind; its answer."""
REFUSAL_TIME = 10.0
"""Time within which any input is answered, seconds."""


def refused(kind: type[Exception], match: str, call: Callable[P, object], *args: P.args, **kwargs: P.kwargs) -> str:
    """The message of the error that a call raises, of a kind and like a regular expression."""
    with pytest.raises(kind, match=match) as caught:
        call(*args, **kwargs)
    return str(caught.value)
