"""Places of modules: the current folder is none of them, because a stranger's recording may lie there.

This module is imported before that holds, and imports only what Python itself has imported at its start.
"""

import os
import sys

_SAFE = "PYTHONSAFEPATH"
"""Environment variable by which Python leaves the current folder out of its places of modules (as by `python -P`)."""


def leave_out_current_folder() -> None:
    """Import nothing more from the current folder, in this process and in all that it starts."""
    sys.path[:] = _without("", os.curdir, _current_folder())
    os.environ[_SAFE] = "1"


class SafeChildren:
    """Processes that are started within the body import nothing from the current folder."""

    def __enter__(self) -> None:
        self._path, self._before = list(sys.path), os.environ.get(_SAFE)
        sys.path[:] = _without("")  # processes of `multiprocessing` get this path
        os.environ[_SAFE] = "1"

    def __exit__(self, *reason: object) -> None:
        sys.path[:] = self._path
        if self._before is None:
            del os.environ[_SAFE]
        else:
            os.environ[_SAFE] = self._before


def _without(*places: str) -> list[str]:
    """The places of modules but these; all of them where this package lies in the current folder."""
    if os.path.dirname(os.path.dirname(os.path.abspath(__file__))) == _current_folder():  # noqa: PTH100, PTH120
        return list(sys.path)
    return [place for place in sys.path if place not in places]


def _current_folder() -> str:
    try:
        return os.getcwd()  # noqa: PTH109
    except OSError:  # it has been deleted
        return ""
