"""Writing of reports, pictures and folders for them."""

from __future__ import annotations

from pathlib import Path

from stseg.errors import OutputError
from stseg.io.outputs.whole_files import replacing


def write_page(path: Path, page: str, overwrite: bool = True) -> None:
    """Write an HTML page, whole or not at all.

    Raises
    ------
    OutputError
        Where the file exists and is not to be overwritten, or cannot be written.
    """
    write_file(path, page.encode("utf-8"), overwrite)


def write_file(path: Path, data: bytes, overwrite: bool = True) -> None:
    """Write a file's bytes, whole or not at all; see `write_page`."""
    with replacing(path, overwrite) as part:
        part.write_bytes(data)


def make_folder(path: Path) -> None:
    """Make a folder unless it exists.

    Raises
    ------
    OutputError
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(path, "", error.strerror or error, "a folder, or a place for one") from error
