"""Which tests, or targets of fuzzing, notice that a check of input is gone?

    python tools/mutants.py tests/io tests/config tests/attacks [--only io/detections] [--every 10] [--most 5]
    python tools/mutants.py --fuzz 60 [--only io] [--every 10]

A mutant lacks one check: a condition that raises is never true, a call that requires or locks is left out, an escape
returns its text, one part of a question `is_...` is always right, a flag of `open` is not given. In a copy below build/
the tests run once while every check is watched, also in the processes that they start: a check that refuses something
notes the test. Then the checks are broken, one after the other, and the tests of their notes run until one fails.
With `--fuzz` all targets of fuzzing take the tests' place, for five minutes; then, for so many seconds, the target in
which the broken check refused most often. Checks that refuse in none are not broken.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import shutil
import subprocess
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from workbench import ROOT

ROOMS = ("io", "stseg/config", "stseg/geometry", "stseg/commands", "stseg/tasks")
ESCAPES = ("printable", "escape", "abbreviated", "mask_passwords", "quote")
PREFIXES = ("require", "refuse", "flock", "lockf", "verify", "check")
FLAGS = ("O_NOFOLLOW", "O_EXCL", "O_NONBLOCK")
COPY = ROOT / "build" / "mutants"
NOTES = COPY / "notes"
WATCH = f"""
import os
def note(check):
    with open({str(NOTES)!r}, "a") as file:
        file.write(check + " " + os.environ.get("PYTEST_CURRENT_TEST", "") + chr(10))
def value(check, found, refusing):
    if bool(found) == refusing: note(check)
    return found
def call(check, work):
    try: return work()
    except BaseException: note(check); raise
def escape(check, work):
    def watched(text):
        if (found := work(text)) != str(text): note(check)
        return found
    return watched
"""


@dataclass(frozen=True)
class Check:
    """A check: its line, where it stands in the tree, what stands there without it, and the call that watches it."""

    line: int
    kind: str
    owner: Any
    key: Any
    without: ast.expr
    watch: str

    def replace(self, other: ast.expr) -> Any:
        """Put something in its place; what stood there."""
        place = self.owner if isinstance(self.owner, list) else vars(self.owner)
        old, place[self.key] = place[self.key], other
        return old


def checks(tree: ast.Module) -> Iterator[Check]:
    """All checks of a module, in one order always."""
    for node in ast.walk(tree):
        match node:
            case ast.If(body=[*_, ast.Raise()]):
                yield Check(node.lineno, "condition", node, "test", ast.Constant(False), "value(K, X, 1)")
            case ast.Expr(value=ast.Call(func=called)) if _name(called).startswith(PREFIXES):
                yield Check(node.lineno, "call", node, "value", ast.Constant(None), "call(K, lambda: X)")
            case ast.FunctionDef(name=name) if name.startswith(("is_", "_is_")):
                for part in ast.walk(node):
                    if isinstance(part, ast.BoolOp) and isinstance(part.op, ast.And):
                        for k, one in enumerate(part.values):
                            yield Check(one.lineno, "question", part.values, k, ast.Constant(True), "value(K, X, 0)")
            case ast.BinOp(op=ast.BitOr(), right=right) if _name(right) in FLAGS:
                yield Check(node.lineno, "flag", node, "right", ast.Constant(0), "value(K, X, 1)")
            case ast.Call(func=called, args=[_]) if _name(called) in ESCAPES:
                yield Check(node.lineno, "escape", node, "func", ast.Name("str"), "escape(K, X)")


def _name(called: ast.AST) -> str:
    return ast.unparse(called).split(".")[-1]


def watched(place: str, text: str) -> str:
    """A module's text with all its checks watched."""
    tree = ast.parse(text)
    for number, check in reversed(list(enumerate(checks(tree)))):
        call: Any = ast.parse(f"_watch.{check.watch.replace('K', repr(f'{place}#{number}'))}", mode="eval").body
        value = check.replace(call)
        if isinstance(call.args[1], ast.Lambda):
            call.args[1].body = value
        else:
            call.args[1] = value
    future = sum("__future__" in ast.unparse(one) for one in tree.body)
    tree.body.insert(future + bool(ast.get_docstring(tree)), ast.parse("from stseg import _watch").body[0])
    return ast.unparse(ast.fix_missing_locations(tree))


def tests_pass(words: Sequence[str], seconds: float | None = None) -> bool:
    """Whether tests pass in the copy."""
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:xdist", "-p", "no:cacheprovider", *words]
    sink, own = None if seconds is None else subprocess.DEVNULL, os.environ | {"PYTHONPATH": str(COPY)}
    with suppress(subprocess.TimeoutExpired):
        return subprocess.run(command, cwd=COPY, env=own, timeout=seconds, stdout=sink, check=False).returncode == 0
    return False


def fuzzing_passes(seconds: float, *words: str) -> bool:
    """Whether fuzzing in the copy finds nothing."""
    command = [sys.executable, "tools/fuzzing.py", "--minutes", str(seconds / 60), *words]
    own = os.environ | {"PYTHONPATH": str(COPY)}
    return subprocess.run(command, cwd=COPY, env=own, capture_output=True, check=False).returncode == 0


def main() -> None:
    """Watch, then break."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="beginning of the paths whose checks are broken")
    parser.add_argument("--every", type=int, default=1, help="one of so many, another draw for each")
    parser.add_argument("--most", type=int, default=5, help="most functions of tests for a check")
    parser.add_argument("--fuzz", type=float, help="seconds of fuzzing for each check, in place of tests")
    given, words = parser.parse_known_args()
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True)
    names = listed.stdout.splitlines()
    for name in names:
        (COPY / name).parent.mkdir(parents=True, exist_ok=True)
        (COPY / name).unlink(missing_ok=True)
        shutil.copy2(ROOT / name, COPY / name, follow_symlinks=False)
    texts = {name: (ROOT / name).read_text() for name in names if name.startswith(ROOMS) and name.endswith(".py")}
    (COPY / "stseg" / "_watch.py").write_text(WATCH)
    for name, text in texts.items():
        (COPY / name).write_text(watched(name, text))
    NOTES.unlink(missing_ok=True)
    fuzzing_passes(300) if given.fuzz else tests_pass(words)
    tests = defaultdict[str, Counter[str]](Counter)
    for noted, _, test in (line.partition(" ") for line in NOTES.read_text().splitlines()):
        tests[noted][test.partition("[")[0].partition(" (")[0]] += 1
    for name, text in texts.items():
        (COPY / name).write_text(text)
    every = [(name, k) for name, text in texts.items() for k, _ in enumerate(checks(ast.parse(text)))]
    every = [one for one in every if one[0].startswith(given.only)]
    every = [one for one in every if not given.fuzz or f"{one[0]}#{one[1]}" in tests]
    chosen, noticed = random.Random(given.every).sample(every, len(every) // given.every), 0
    for name, number in sorted(chosen):
        tree = ast.parse(texts[name])
        check = list(checks(tree))[number]
        check.replace(check.without)
        (COPY / name).write_text(ast.unparse(ast.fix_missing_locations(tree)))
        seen = [test for test, _ in tests[f"{name}#{number}"].most_common(given.most) if test]
        if given.fuzz:
            is_noticed = not fuzzing_passes(given.fuzz, "--first", "--target", seen[0])
        else:
            is_noticed = bool(seen) and not tests_pass(["-x", *seen], 300)
        (COPY / name).write_text(texts[name])
        noticed += is_noticed
        print(f"| {name}:{check.line} | {check.kind} | {is_noticed} | {' '.join(seen)} |", flush=True)
    print(f"{len(chosen)} of {len(every)} checks were left out; noticed: {100 * noticed / len(chosen):.1f} %")


if __name__ == "__main__":
    main()
