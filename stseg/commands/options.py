"""Options of several commands."""

from typing import Annotated

from cyclopts import Parameter

Overwrite = Annotated[bool, Parameter(negative="", help="Replace what exists.")]
Frames = Annotated[str | None, Parameter(metavar="A:B")]
Settings = Annotated[tuple[str, ...], Parameter(name="--set", metavar="SECTION.KEY=VALUE", negative="")]
