"""XML from untrusted sources, read without document types, so that no entity can be declared and expanded."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

from stseg.errors import FormatError
from stseg.io.untrusted.bounded_files import read_text


def parse_xml(file: Path, expected: str) -> ElementTree.Element:
    """The root of an XML file.

    Parameters
    ----------
    file
    expected
        The expected kind of XML, for errors.

    Raises
    ------
    FormatError
        Where it cannot be read, is no XML, or declares a document type.
    """
    try:
        text = read_text(file)
        # Entities are declared in a document type, which no calibration has: refusing it leaves nothing to expand.
        # The check is on decoded text and the parser gets that text, so no declared encoding can hide one.
        if "<!DOCTYPE" in text or "<!ENTITY" in text:
            raise FormatError(file, "", "a document type declaration", f"{expected}, which has none")
        return ElementTree.fromstring(text)
    except OSError as error:
        raise FormatError(file, "", error.strerror or error, "a calibration file") from error
    except (ElementTree.ParseError, ValueError, RecursionError) as error:
        raise FormatError(file, "", f"what is not XML ({error})", expected) from error
