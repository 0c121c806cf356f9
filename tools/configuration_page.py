"""Write the table of keys for users in docs/configuration.md anew, from stseg/config.

python tools/configuration_page.py
"""

import re
from pathlib import Path

from stseg.config import Config
from stseg.config.keys import USER_KEYS, describe, values

PAGE = Path(__file__).parents[1] / "docs" / "configuration.md"
_PART = re.compile(r"(<!-- keys: begin.*? -->\n).*?(<!-- keys: end -->)", re.DOTALL)


def table() -> str:
    """The keys for users, their defaults and meanings."""
    rows = [f"| `{key}` | {_shown(value)} | {describe(key)} |" for key, value in values(Config()) if key in USER_KEYS]
    return "\n".join(["| key | default | meaning |", "| --- | --- | --- |", *rows]) + "\n"


def rewritten(page: str) -> str:
    """The page with the present table."""
    return _PART.sub(lambda found: f"{found[1]}{table()}{found[2]}", page)


def _shown(value: object) -> str:
    return ", ".join(map(str, value)) if isinstance(value, tuple) else str(value)


if __name__ == "__main__":
    PAGE.write_text(rewritten(PAGE.read_text("utf-8")), "utf-8")
