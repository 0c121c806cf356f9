"""Who may import whom, read from the sources."""

import ast
import sys
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

import pytest
from checks import tables
from recordings import process

ROOT = Path(__file__).parents[2]

RULES = tables(Path(__file__).with_suffix(".toml"))
FOUNDATION, NEEDED, AT_HOME = RULES["foundation"], RULES["needed"], RULES["at_home"]
STAGES, BESIDE, OTHERS = RULES["stages"], RULES["beside"], RULES["others"]


@dataclass(frozen=True)
class Module:
    """A source file of the package."""

    name: str
    tree: ast.Module

    @property
    def part(self) -> str:
        """The part of the package that it belongs to: `stseg.io.recording.rigs` is of `io`."""
        return f"{self.name}.__init__".split(".")[1]

    @cached_property
    def imports(self) -> set[str]:
        """Full names of what it imports; of `from a import b`, both a and a.b."""
        names = set[str]()
        for node in ast.walk(self.tree):
            if isinstance(node, ast.Import):
                names |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                assert node.level == 0, f"{self.name} line {node.lineno}: a relative import"
                names |= {node.module or "", *(f"{node.module}.{alias.name}" for alias in node.names)}
        return names


@cache
def modules() -> list[Module]:
    # The link stseg/io is not followed by glob on every Python, so the folder behind it is read by itself.
    found = {path: ("stseg", *path.relative_to(ROOT / "stseg").parts) for path in (ROOT / "stseg").rglob("*.py")}
    found = {path: parts for path, parts in found.items() if parts[1] != "io"}
    found |= {path: ("stseg", "io", *path.relative_to(ROOT / "io").parts) for path in (ROOT / "io").rglob("*.py")}
    return [
        Module(".".join(parts).removesuffix(".py").removesuffix(".__init__"), ast.parse(path.read_text("utf-8")))
        for path, parts in sorted(found.items())
    ]


def parts_imported(module: Module) -> set[str]:
    """Parts of the package that a module imports, its own left out."""
    taken = {name.split(".")[1] for name in module.imports if name.startswith("stseg.")}
    assert taken <= {*ALLOWED}, f"{module.name} imports {taken - {*ALLOWED}}, of which no rule is known"
    return taken - {module.part}


GROUPS = {"foundation": {*FOUNDATION}, "stages": {*STAGES}, "beside": {*BESIDE} - {"baselines"}}
ALLOWED = {
    **{part: set(FOUNDATION[:k]) for k, part in enumerate(FOUNDATION)},
    **{stage: {*FOUNDATION, *parts} for stage, parts in STAGES.items()},
    **{part: set().union(*(GROUPS.get(one, {one}) for one in parts)) for part, parts in (BESIDE | OTHERS).items()},
}
"""What the modules of a part may import."""


def test_a_module_imports_what_stands_below_it() -> None:
    above = {module.name: parts_imported(module) - ALLOWED[module.part] for module in modules()}
    assert {name: parts for name, parts in above.items() if parts} == {}


@pytest.mark.parametrize("library", AT_HOME)
def test_a_library_is_known_where_it_belongs(library: str) -> None:
    at_home = [module for module in modules() if library in {name.split(".")[0] for name in module.imports}]
    for module in at_home:
        assert module.name.startswith(tuple(AT_HOME[library])), f"{module.name} imports {library}"
    assert at_home, f"nothing imports {library}"


def test_every_other_library_is_numpy_scipy_or_of_python_itself() -> None:
    known = {*AT_HOME, *NEEDED, *sys.stdlib_module_names, "stseg"}
    for module in modules():
        assert {name.split(".")[0] for name in module.imports} <= known, module.name


def test_only_commands_print_and_no_drawer_is_for_odds_and_ends() -> None:
    calls = [(file.part, node) for file in modules() for node in ast.walk(file.tree) if isinstance(node, ast.Call)]
    assert {part for part, node in calls if getattr(node.func, "id", "") == "print"} == {"commands"}
    for module in modules():
        assert not {"utils", "util", "helpers", "misc", "common"} & set(module.name.split("."))
    # With an __init__.py, io would hide Python's own io from type checkers and, without frozen modules, from Python.
    assert not (ROOT / "io" / "__init__.py").exists()
    assert (ROOT / "stseg" / "io" / "track_csv.py").samefile(ROOT / "io" / "track_csv.py")


def test_a_run_imports_no_library_or_baseline_in_vain() -> None:
    imported = "stseg.commands.terminal.standard_error, stseg.engine.track, stseg.tasks.warnings"
    started = f"import {imported}, sys; print(*sys.modules)"
    found = set(process(started).stdout.split())
    assert "stseg.engine.track" in found
    assert not {"rich", "ssl", "scipy.optimize", "stseg.engine.live.following"} & found
    made = (
        "import sys, stseg.engine.track, stseg.engine.live.following, stseg.commands.run\n"
        "from scenes import CONFIG, room\n"
        "from stseg.engine.pipeline import Pipeline\n"
        "Pipeline(room(), ['pixels'] * 4, CONFIG, 'cut').tracker(room(), CONFIG, 0)\n"
        "print(*sys.modules)"
    )
    modules = process(made).stdout.split()
    assert "stseg.trackers.cut" in modules
    assert [name for name in modules if name.startswith("stseg.baselines")] == []
