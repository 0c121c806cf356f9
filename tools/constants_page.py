"""Write the tables of constants in docs/how-it-works.md anew, from stseg/config.

    python tools/constants_page.py

The meaning of a constant is the text that stands below it in the source.
"""

from __future__ import annotations

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "how-it-works.md"
_MARKED = re.compile(r"<!-- constants: (\w+) -->\n.*?<!-- end -->", re.DOTALL)


def configuration() -> str:
    """The source of all modules of the configuration, one after the other."""
    return "\n".join(path.read_text(encoding="utf-8") for path in sorted((ROOT / "stseg" / "config").glob("*.py")))


def stages(source: str) -> dict[str, list[tuple[str, str, str]]]:
    """Name, default and meaning of the constants of each stage."""
    classes = {node.name: node for node in ast.parse(source).body if isinstance(node, ast.ClassDef)}
    return {
        field.target.id: _constants(classes[ast.unparse(field.annotation)], classes)
        for field in classes["Config"].body
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)
    }


def rewrite(page: str, source: str) -> str:
    """The page with its marked tables made anew; the text around them stays."""
    known = stages(source)

    def table(found: re.Match[str]) -> str:
        rows = [f"| `{found[1]}.{name}` | {default} | {meaning} |" for name, default, meaning in known[found[1]]]
        head = ["| constant | default | meaning |", "| --- | --- | --- |"]
        return "\n".join([f"<!-- constants: {found[1]} -->", *head, *rows, "<!-- end -->"])

    return _MARKED.sub(table, page)


def _constants(stage: ast.ClassDef, classes: dict[str, ast.ClassDef]) -> list[tuple[str, str, str]]:
    """Those it inherits, its own, and of tables in it those that differ from constants of the same name before."""
    found = [row for base in stage.bases for row in _constants(classes[ast.unparse(base)], classes)]
    for field, below in zip(stage.body, [*stage.body[1:], None], strict=True):
        if not (isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)):
            continue
        name, kind = field.target.id, ast.unparse(field.annotation)
        if kind in classes:
            inner = [row for row in _constants(classes[kind], classes) if row not in found]
            found = [*found, *((f"{name}.{key}", default, meaning) for key, default, meaning in inner)]
            continue
        if not (isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant)):
            raise SystemExit(f"stseg/config: {name} has no meaning below it")
        default = ast.unparse(field.value).strip("()") if field.value else ""
        found.append((name, default, " ".join(str(below.value.value).split())))
    return found


def main() -> None:
    """Rewrite the page."""
    PAGE.write_text(rewrite(PAGE.read_text(encoding="utf-8"), configuration()), encoding="utf-8")


if __name__ == "__main__":
    main()
