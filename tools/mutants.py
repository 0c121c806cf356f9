"""Which tests, or targets of fuzzing, notice that a check of input is gone?

    python tools/mutants.py tests/io tests/config tests/attacks [--only io/detections] [--every 10] [--most 5]
    python tools/mutants.py --fuzz 60 [--only io] [--every 10]

A mutant lacks one check: a condition that raises is never true, a call that requires or locks is left out, an escape
returns its text, one part of a question `is_...` is always right, a flag of `open` is not given. In a copy below build/
the tests run once while every check is watched, also in the processes that they start: a check that refuses something
notes the test. Then the checks are broken, one after the other, and the tests of their notes run until one fails, but
for those that fail under watch. No process has more than 6 GiB of data: some checks bound memory.
With `--fuzz` all targets of fuzzing take the tests' place for five minutes; then, for so many seconds, the target in
which the broken check refused most often, if any. A check makes no difference, and is no part of the share, where
fuzzing without it fails nowhere and answers all files of its notes, ten or more, alike.
"""

import argparse
import ast
import os
import random
import resource
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
NOTES, ANSWERS, SAID = COPY / "notes", COPY / "answers", COPY / "said"
LEAST_FILES, MOST_DATA = 10, 6 << 30
TESTS = ("-m", "pytest", "-q", "-p", "no:xdist", "-p", "no:cacheprovider")
FUZZING = ("tools/fuzzing.py", "--minutes")
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


def passes(words: Sequence[str], seconds: float | None = None) -> bool:
    """Whether a program of Python passes in the copy; what it says stands in SAID."""
    noted = {"FUZZ_ANSWERS": str(ANSWERS)} if words[0] == FUZZING[0] else {}
    own = os.environ | {"PYTHONPATH": str(COPY)} | noted
    ANSWERS.unlink(missing_ok=True)
    with SAID.open("w") as said, suppress(subprocess.TimeoutExpired):
        program = [sys.executable, *words]
        return subprocess.run(program, cwd=COPY, env=own, timeout=seconds, stdout=said, check=False).returncode == 0
    return False


def answers() -> dict[str, str]:
    """The last fuzzing's files, by target and seed, and whether each was refused."""
    return dict(line.rsplit(" ", 1) for line in ANSWERS.read_text().splitlines()) if ANSWERS.exists() else {}


def main() -> None:
    """Watch, then break."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="beginning of the paths whose checks are broken")
    parser.add_argument("--every", type=int, default=1, help="one of so many, another draw for each")
    parser.add_argument("--most", type=int, default=5, help="most functions of tests for a check")
    parser.add_argument("--fuzz", type=float, help="seconds of fuzzing for each check, in place of tests")
    given, words = parser.parse_known_args()
    resource.setrlimit(resource.RLIMIT_DATA, (MOST_DATA, MOST_DATA))
    names = subprocess.check_output(["git", "ls-files"], cwd=ROOT, text=True).splitlines()
    for name in names:
        (COPY / name).parent.mkdir(parents=True, exist_ok=True)
        (COPY / name).unlink(missing_ok=True)
        shutil.copy2(ROOT / name, COPY / name, follow_symlinks=False)
    texts = {name: (ROOT / name).read_text() for name in names if name.startswith(ROOMS) and name.endswith(".py")}
    (COPY / "stseg" / "_watch.py").write_text(WATCH)
    for name, text in texts.items():
        (COPY / name).write_text(watched(name, text))
    NOTES.unlink(missing_ok=True)
    passes([*FUZZING, "5"] if given.fuzz else [*TESTS, *words])
    told = [line.split(" ") for line in SAID.read_text().splitlines() if line.startswith(("FAILED ", "ERROR "))]
    failed = {test.partition("[")[0] for _, test, *_ in told}
    before, tests, files = answers(), defaultdict[str, Counter[str]](Counter), defaultdict[str, set[str]](set)
    for noted, test in (line.split(" ", 1) for line in NOTES.read_text().splitlines() if " " in line.rstrip()):
        files[noted].add(test)
        tests[noted][test.partition("[")[0].partition(" ")[0]] += 1
    for name, text in texts.items():
        (COPY / name).write_text(text)
    own = [name for name in texts if name.startswith(given.only)]
    every = [(name, k) for name in own for k, _ in enumerate(checks(ast.parse(texts[name])))]
    every = [one for one in every if not given.fuzz or f"{one[0]}#{one[1]}" in tests]
    chosen, verdicts = random.Random(given.every).sample(every, len(every) // given.every), Counter[str]()
    for name, number in sorted(chosen):
        tree = ast.parse(texts[name])
        check = list(checks(tree))[number]
        check.replace(check.without)
        (COPY / name).write_text(ast.unparse(ast.fix_missing_locations(tree)))
        key = f"{name}#{number}"
        seen = [test for test, _ in tests[key].most_common() if test not in failed][: given.most]
        run = [*FUZZING, str(given.fuzz / 60), "--first", "--target", seen[0]] if given.fuzz else [*TESTS, "-x", *seen]
        verdict = "noticed" if seen and not passes(run, (given.fuzz or 0) + 300) else "missed"
        common = files[key] & before.keys() & (after := answers()).keys()
        if len(common) >= LEAST_FILES and verdict == "missed" and all(before[one] == after[one] for one in common):
            verdict = "no difference"
        (COPY / name).write_text(texts[name])
        if given.fuzz and verdict == "noticed":  # unless the next file is answered wrongly with the check, too
            seed = 1 + max((int(file.rsplit(" ", 1)[1]) for file in answers() if " " in file), default=-1)
            verdict = verdict if passes([*FUZZING, "0.05", "--target", seen[0], "--seed", str(seed)]) else "missed"
        verdicts[verdict] += 1
        print(f"| {name}:{check.line} | {check.kind} | {verdict} | {' '.join(seen)} |", flush=True)
    share = verdicts["noticed"] / max(len(chosen) - verdicts["no difference"], 1)
    print(f"{len(chosen)} of {len(every)} checks were left out: {dict(verdicts)}; noticed: {100 * share:.1f} %")


if __name__ == "__main__":
    main()
