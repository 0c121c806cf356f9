"""Keys of the configuration: names, descriptions, which are meant for users, and which have an effect."""

import ast
import inspect
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from functools import cache
from textwrap import dedent
from typing import Any

from stseg.config import Config
from stseg.errors import ConfigError

_USER = {
    "body": "height_mean height_spread width_mean width_spread heights",
    "motion": "speed_spread velocity_noise position_noise",
    "foreground": "model body_rows",
    "foreground.mixture": "memory absorption_time darkest_shadow",
    "detection": "prior_log_odds birth_cost border_width minimum_distance",
    "tracking": "window patience return_probability maximum_gap interpolation_gap minimum_duration",
    "segments": "length background_period",
    "live": "file_quiet_time background_time stream_timeout buffer_time buffer_memory",
}
USER_KEYS = frozenset(f"{section}.{name}" for section, names in _USER.items() for name in names.split())
"""Keys in words of the recording: people, cameras, patience. All others are constants of the methods.

Those of the background model are named by the default model, and stand for the same ones of the chosen model.
"""
_PROPOSALS = {
    "lattice": ("proposals.source",),
    "volume": ("proposals.source", "proposals.kernel_radius"),
    "probability": ("proposals.",),
    "both": ("proposals.",),
}
"""Keys that are read with each source of proposals."""


def is_user_key(key: str, model: str) -> bool:
    """Whether a key, as `section.key`, is meant for users of a background model."""
    return key.replace(f"foreground.{model}.", "foreground.mixture.") in USER_KEYS and (
        model == "mixture" or not key.startswith("foreground.mixture.")
    )


def describe(key: str) -> str:
    """Meaning and unit of a key, given as `section.key`."""
    *tables, name = key.split(".")
    settings: Any = Config()
    for table in tables:
        settings = getattr(settings, table)
    return _descriptions(type(settings))[name]  # type: ignore[arg-type]  # a class can be hashed


def values(settings: Any, table: str = "") -> Iterator[tuple[str, object]]:
    """Every key below some settings, as `section.key`, with its value."""
    for field in fields(settings):
        value = getattr(settings, field.name)
        if is_dataclass(value):
            yield from values(value, f"{table}{field.name}.")
        else:
            yield f"{table}{field.name}", value


@cache
def _descriptions(kind: type) -> dict[str, str]:
    """The text below each field of a dataclass, its bases' included, on one line."""
    described: dict[str, str] = {}
    for base in reversed([one for one in kind.__mro__ if is_dataclass(one)]):
        (tree,) = ast.parse(dedent(inspect.getsource(base))).body
        assert isinstance(tree, ast.ClassDef)
        for field, text in zip(tree.body, tree.body[1:], strict=False):
            if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name):
                assert isinstance(text, ast.Expr), f"{base.__name__}.{field.target.id} has no description"
                described[field.target.id] = " ".join(ast.literal_eval(text.value).split())
    return described


def require_effect(config: Config, tracker: str) -> None:
    """Refuse a value that was changed, but that the chosen model, proposals and tracker do not read.

    Raises
    ------
    ConfigError
        It names the key, and the choice with which it has an effect.
    """
    defaults = dict(values(Config()))
    for key, value in values(config):
        if value != defaults[key]:
            for prefix, chosen, needed in _conditions(config, tracker):
                if key.startswith(prefix) and not key.startswith(chosen):
                    raise ConfigError("configuration", key, f"a value without effect: {value}", needed)


def _conditions(config: Config, tracker: str) -> Iterator[tuple[str, tuple[str, ...], str]]:
    """Prefixes of keys, those among them that are read, and what the others need."""
    for model in _tables(config.foreground, "stseg.config.foreground"):
        chosen = (f"foreground.{config.foreground.model}.",)
        yield f"foreground.{model}.", chosen, f"foreground.model = {model} beside it, or the default"
    yield "proposals.", _PROPOSALS[config.proposals.source], "another proposals.source beside it, or the default"
    for name in _tables(config, "stseg.config.trackers"):
        yield f"{name}.", (f"{tracker}.",), f"--tracker {name} beside it, or the default"
    if tracker not in ("cut", "frames"):
        yield "tracking.return_probability", (), "--tracker cut beside it, or the default"
    if tracker != "cut":
        for prefix in ("segmentation.", "tracking.prediction_horizon"):
            yield prefix, (), "--tracker cut beside it, or the default"


def _tables(settings: object, module: str) -> list[str]:
    """Tables among some settings whose constants are of a module."""
    return [name for name, value in vars(settings).items() if type(value).__module__ == module]
