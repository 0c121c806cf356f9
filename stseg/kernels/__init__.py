"""Compiled code.

numba reads a file `.numba_config.yaml` of the current folder at its import and before each compilation. It may be a
stranger's, and change what is computed and which machine code is run. So numba is imported here, without that file.
"""

import os
import sys
import warnings


def _leave_out_file_of_current_folder() -> None:
    before = sys.modules.get("yaml")
    sys.modules["yaml"] = None  # type: ignore[assignment]  # so numba finds no reader of that file
    try:
        with warnings.catch_warnings(action="ignore"):  # that there is none
            from numba.core import config
    finally:
        del sys.modules["yaml"]
        if before is not None:
            sys.modules["yaml"] = before
    config._config_fname = os.devnull


_leave_out_file_of_current_folder()
