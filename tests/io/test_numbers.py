"""The one reader of numbers that all parsers use."""

from __future__ import annotations

import numpy as np
import pytest

from stseg.io.untrusted.values import parse_number, parse_whole


@pytest.mark.parametrize("text", ["1_000", "٣", "inf", "nan", "1e999", "0x1", "", " ", "1" * 500, "1e", "--1"])
def test_what_is_no_number(text: str) -> None:
    assert np.isnan(parse_number(text))


@pytest.mark.parametrize("text", ["1", " -1.5 ", "+.5", "5.", "1e-3", "1E5"])
def test_numbers_are_read_as_python_reads_them(text: str) -> None:
    assert parse_number(text) == float(text)


def test_whole_numbers_are_within_their_range() -> None:
    assert parse_whole("7", 0, 9) == 7
    assert parse_whole("10", 0, 9) is None
    assert parse_whole("1" * 5000, 0, 9) is None
