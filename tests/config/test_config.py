"""The configuration: what is read comes back from its own text, what is wrong is named."""

import re
import tomllib
from dataclasses import dataclass, field, fields, replace
from functools import reduce
from pathlib import Path
from typing import Any, Literal

import pytest
from checks import Command, cases, drawn, refused
from hypothesis import strategies as st

from stseg.config import BodyConfig, Config
from stseg.config.keys import USER_KEYS, describe, require_effect, values
from stseg.config.ranges import require
from stseg.errors import ConfigError
from stseg.io.config_file import Given, as_toml, build, describe_config, read_config

TOML = """
[detection]
prior_log_odds = -2    # a whole number is a number
search_rounds = 3
[body]
heights = [1.5, 1.75]
"""


@dataclass(frozen=True)
class Inner:
    share: float = 0.5
    pair: tuple[float, float] = (0.0, 1.0)
    names: tuple[str, ...] = ()
    limit: int | None = None

    def __post_init__(self) -> None:
        require(0 <= self.share <= 1, self, "share", "a share from 0 to 1")


@dataclass(frozen=True)
class Outer:
    kind: Literal["masks", "boxes"] = "masks"
    quick: bool = False
    count: int = 3
    inner: Inner = field(default_factory=Inner)


def read(path: Path, text: str, *assignments: str) -> Config:
    path.write_text(text)
    return read_config(path, assignments)


def wrapped(table: dict[str, Any]) -> dict[str, Any]:
    return {
        name: wrapped(value) if isinstance(value, dict) else Given(value, "file.toml") for name, value in table.items()
    }


def test_nothing_given_is_the_default_and_texts_need_no_quotes() -> None:
    assert read_config(None) == Config()
    assert build(Outer, {"kind": Given("boxes", "--set")}, "--set").kind == "boxes"


def test_files_and_assignments_differ_and_read_back_equal(tmp_path: Path) -> None:
    rounds = ("detection.search_rounds = 5", "detection.search_rounds=6")
    config = read(tmp_path / "c.toml", TOML, "detection.prior_log_odds=-1.5", *rounds)
    expected = replace(Config().detection, prior_log_odds=-1.5, search_rounds=6)
    assert config == replace(Config(), body=BodyConfig(heights=(1.5, 1.75)), detection=expected)
    assert isinstance(read(tmp_path / "c.toml", TOML).detection.prior_log_odds, float)
    config = read_config(None, ["detection.prior_log_odds=-1e-3", "body.heights=[1, 1.25]"])
    text = as_toml(config)
    assert read(tmp_path / "c.toml", text) == config
    table = tomllib.loads(text)
    assert list(table) == [stage.name for stage in fields(Config)]
    for stage in fields(Config):
        assert list(table[stage.name]) == [key.name for key in fields(getattr(config, stage.name))]


finite = st.floats(allow_nan=False, allow_infinity=False)


texts = st.lists(st.text(st.characters(exclude_categories=["Cs"]))).map(tuple)
inner = st.builds(Inner, st.floats(0, 1), st.tuples(finite, finite), texts, st.none() | st.integers(0, 9))


@drawn(
    100, st.builds(Outer, st.sampled_from(("masks", "boxes")), st.booleans(), st.integers(-(2**63), 2**63 - 1), inner)
)
def test_any_settings_read_back_equal_from_their_text(settings: Outer) -> None:
    assert build(Outer, wrapped(tomllib.loads(as_toml(settings))), "file.toml") == settings


@cases()
def test_wrong_values_are_named_with_what_was_expected(table: dict[str, Any], message: str) -> None:
    refused(ConfigError, f"^file.toml: .*{re.escape(message)}$", build, Outer, wrapped(table), "file.toml")


@cases()
def test_wrong_assignments_name_the_option(tmp_path: Path, assignment: str, message: str) -> None:
    refused(ConfigError, re.escape(message), read, tmp_path / "c.toml", TOML, assignment)


def test_a_fault_is_laid_where_the_value_was_given(tmp_path: Path) -> None:
    path = tmp_path / "c.toml"
    text, said = "[detection]\nsearch_rounds = 'x'", r"c\.toml: detection\.search_rounds: found 'x'"
    refused(ConfigError, said, read, path, text, "detection.prior_log_odds=1")
    refused(ConfigError, r"c\.toml: found what is not TOML", read, path, "[detection\n")
    path.write_bytes(b"# \xff")
    refused(ConfigError, r"c\.toml: found bytes that are no UTF-8 at 2", read_config, path)
    refused(ConfigError, r"none\.toml: found No such file", read_config, tmp_path / "none.toml")


@pytest.mark.parametrize("wrong", [{"width_mean": 0.05}, {"heights": (1.8, 1.7)}, {"heights": ()}])
def test_bodies_without_meaning_are_refused(wrong: dict[str, Any]) -> None:
    refused(ConfigError, next(iter(wrong)), BodyConfig, **wrong)


@pytest.mark.parametrize("expert", [False, True])
@pytest.mark.parametrize("assignments", [(), ("foreground.model=codebook", "body.height_mean=1.2")])
def test_a_printed_configuration_can_be_given_back(tmp_path: Path, expert: bool, assignments: tuple[str, ...]) -> None:
    config = read_config(None, assignments)
    assert read(tmp_path / "c.toml", describe_config(config, expert=expert)) == config


def test_users_see_few_keys_experts_all_and_their_meaning() -> None:
    few, every = (tomllib.loads(describe_config(Config(), expert=expert)) for expert in (False, True))
    assert len(USER_KEYS) <= 30 and count(few) == len(USER_KEYS)
    assert count(every) == len(dict(values(Config())))
    chosen = tomllib.loads(describe_config(read_config(None, ["foreground.model=codebook"]), expert=False))
    assert set(chosen["foreground"]) == {"model", "body_rows", "codebook"}
    for key, _ in values(Config()):
        assert describe(key).endswith("."), key


def count(table: dict[str, Any]) -> int:
    return sum(count(value) if isinstance(value, dict) else 1 for value in table.values())


@cases()
def test_a_value_without_effect_is_refused(assignments: tuple[str, ...], tracker: str, found: str) -> None:
    refused(ConfigError, found, require_effect, read_config(None, assignments), tracker)


@cases()
def test_a_value_with_effect_is_taken(assignments: tuple[str, ...], tracker: str) -> None:
    require_effect(read_config(None, assignments), tracker)


def test_the_command_prints_a_file_that_a_run_takes(tmp_path: Path, refusal: Command, stdout: Command) -> None:
    printed = stdout("config", "--set", "body.height_mean=1.2", "--expert")
    assert read(tmp_path / "c.toml", printed) == read_config(None, ["body.height_mean=1.2"])
    assert "did you mean heights?" in refusal("config", "--set", "body.height=1")


@cases()
def test_constants_of_stages_out_of_range_are_named(wrong: str) -> None:
    place, value = wrong.split("=")
    *sections, key = place.split(".")
    config = reduce(getattr, sections, Config())
    refused(ConfigError, key, replace, config, **{key: type(getattr(config, key))(value)})
