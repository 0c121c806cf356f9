"""A short round of fuzzing with fixed seeds; `python tools/fuzzing.py --minutes 60` goes on."""

import sys
import time
from pathlib import Path

import pytest
from checks import drawn, in_ci
from fuzz.runner import fuzz
from fuzz.targets import TARGETS, Target
from hypothesis import strategies as st

from stseg.errors import printable
from stseg.io.toml import parse_toml
from stseg.io.untrusted.values import abbreviated, is_name, parse_number, parse_whole

SEEDS = [(1_000_000, 10), *in_ci(((1_000_010, 15),))]
"""First seed and number of mutated files of each target."""


@pytest.mark.skipif(sys.platform != "linux", reason="forks")
@pytest.mark.parametrize("seeds", SEEDS)
@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name)
def test_mutated_files_are_answered(target: Target, seeds: tuple[int, int]) -> None:
    _, failures = fuzz(target, seeds[0], time.monotonic() + 20, seeds[1])
    assert not failures


@drawn(200, st.text(max_size=40))
def test_numbers_are_pythons_and_names_are_printable(text: str) -> None:
    number = parse_number(text)
    assert number != number or number == float(text)
    whole = parse_whole(text, -100, 100)
    assert whole is None or whole == int(text)
    assert printable(text).isprintable() and abbreviated(text).isprintable()
    assert not is_name(text) or (Path(text).name == text and text.isprintable())


@drawn(200, st.text(st.sampled_from("ab.=[]{}\"'#\n 19-_eE+,"), max_size=60))
def test_any_text_is_toml_or_one_line(text: str) -> None:
    try:
        parse_toml(text)
    except ValueError as error:
        assert "\n" not in str(error)
