"""Range checks of settings: what the dataclasses of the configuration hold themselves to."""

from __future__ import annotations

from stseg.errors import ConfigError


def require(holds: bool, settings: object, name: str, expected: str) -> None:
    """Refuse a setting that is out of its range; for the `__post_init__` of settings.

    Raises
    ------
    ConfigError
        With the place "configuration"; `stseg.io.toml.settings.build` puts there where the user wrote it.
    """
    if not holds:
        raise ConfigError("configuration", name, repr(getattr(settings, name)), expected)
