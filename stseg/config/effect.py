"""Keys that have no effect with the chosen background model, proposals or tracker."""

from __future__ import annotations

from collections.abc import Iterator

from stseg.config import Config
from stseg.config.keys import values
from stseg.errors import ConfigError

_PROPOSALS = {
    "lattice": ("proposals.source",),
    "volume": ("proposals.source", "proposals.kernel_radius"),
    "probability": ("proposals.",),
    "both": ("proposals.",),
}
"""Keys that are read with each source of proposals."""


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
        for prefix in ("segmentation.", "tracking.prediction_horizon", "tracking.assignment_distance"):
            yield prefix, (), "--tracker cut beside it, or the default"


def _tables(settings: object, module: str) -> list[str]:
    """Tables among some settings whose constants are of a module."""
    return [name for name, value in vars(settings).items() if type(value).__module__ == module]
