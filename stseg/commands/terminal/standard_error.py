"""Standard error for what commands say: libraries that decode pictures write there past every handler."""

from __future__ import annotations

import faulthandler
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from io import TextIOWrapper

DESCRIPTOR = 2


@contextmanager
def without_library_messages() -> Iterator[None]:
    """Meanwhile descriptor 2 leads nowhere, and sys.stderr to where it led before.

    libjpeg and libpng print every fault of a picture, and OpenCV has no switch for it. What cannot be decoded is an
    error of ours. With `python -X faulthandler` libraries are heard.
    """
    try:
        kept = os.dup(DESCRIPTOR)
    except OSError:  # closed by whoever started us
        kept = -1
    if kept < 0 or faulthandler.is_enabled():
        yield
        return
    stream = sys.stderr
    if isinstance(stream, TextIOWrapper) and stream.fileno() == DESCRIPTOR:
        sys.stderr = os.fdopen(kept, "w", 1, stream.encoding, stream.errors, closefd=False)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, DESCRIPTOR)
    os.close(nowhere)
    try:
        yield
    finally:
        sys.stderr.flush()
        sys.stderr = stream
        os.dup2(kept, DESCRIPTOR)
        os.close(kept)
