"""Names and docstrings are nouns of the field: no bare adjective names a constant, no participle a variable."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
FILES = (path for room in ("stseg", "io") for path in (ROOT / room).rglob("*.py"))
SOURCES = sorted(path for path in FILES if "stseg/io" not in path.as_posix())
ADJECTIVES = re.compile(
    r"_?(MOST|NEAR|LEAST|FAR|STEPS?|ALIKE|APART|REACH|LASTING|SURE|STILL|FEW|WORSE|OUT|TALL|WIDE|SEEN|DOUBTFUL|ALLOWED|"
    r"USUAL|FREELY|NOBODY|EARLY|LATE|FIRST|LAST|KNOWN|OWN|SHARP|LONG|SHORT|SMALL|LARGE|MANY|ENOUGH|UNKNOWN|FRESH|OPEN|"
    r"CLOSE|CLEAR|HIGH|LOW|BEYOND|BESIDE|TOLD|KEPT|TAKEN|HELD|EVERY|ASKED|LEFT|MET|SAME|HIDDEN|SILENT)"
)
PARTICIPLES = {"own", "seen", "shown", "near", "taken", "held", "beside", "apart", "fresh", "asked", "told", "there"}
PARTICIPLES |= {"said", "aside", "looks", "beyond", "whose", "whom", "nobody", "somebody"}
QUESTIONS = re.compile(r"\s*(What|How|Who|Whom|Whose|Of)\b")


def bound_names(tree: ast.AST) -> Iterator[str]:
    """Names that a module binds: variables, parameters, functions."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id
        elif isinstance(node, ast.arg):
            yield node.arg
        elif isinstance(node, ast.FunctionDef):
            yield node.name


def texts(tree: ast.AST) -> Iterator[str]:
    """Docstrings, and the texts below constants and fields."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            yield node.value.value


def poor_names(tree: ast.Module) -> Iterator[str]:
    """Participles and questions of a module, and its constants that are adjectives."""
    yield from PARTICIPLES & set(bound_names(tree))
    yield from (text for text in texts(tree) if QUESTIONS.match(text))
    constants = (
        name.id
        for statement in tree.body
        if isinstance(statement, ast.Assign | ast.AnnAssign)
        for name in ast.walk(statement)
        if isinstance(name, ast.Name) and isinstance(name.ctx, ast.Store)
    )
    yield from (name for name in constants if ADJECTIVES.fullmatch(name))


def test_names_are_nouns() -> None:
    found = {path.relative_to(ROOT).as_posix(): [*poor_names(ast.parse(path.read_text("utf-8")))] for path in SOURCES}
    assert {name: poor for name, poor in found.items() if poor} == {}


def test_names_of_tests_are_short() -> None:
    names = [
        name
        for path in (ROOT / "tests").rglob("test_*.py")
        for name in re.findall(r"def (test_\w+)", path.read_text("utf-8"))
    ]
    assert names and not [name for name in names if len(name) > 60]
