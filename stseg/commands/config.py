"""`stseg config`: the configuration as a file that can be given back."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from stseg.commands.options import Settings
from stseg.io.config_file import describe_config, read_config


def config(
    *, config: Path | None = None, set_: Settings = (), expert: Annotated[bool, Parameter(negative="")] = False
) -> None:
    """Print the configuration, with the meaning and unit of every key, as a TOML file.

    Example: stseg config > config.toml; edit it; stseg run rig.toml -o run.h5 --config config.toml

    Parameters
    ----------
    config
        A TOML file whose values are printed instead of the defaults.
    set_
        One value, for example --set body.height_mean=1.2; may be given several times.
    expert
        Print the constants of the methods as well.
    """
    print(describe_config(read_config(config, set_), expert=expert), end="")
