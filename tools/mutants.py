"""Which tests notice that a check of input is gone?

    python tools/mutants.py tests/io tests/config tests/attacks [--every 10] [--most 20]

A mutant lacks one check of input: a condition that raises is never true, a call that requires or locks is left out, an
escape returns its text, one part of a question `is_...` is always right, a flag of `open` is not given. Each lives in a
copy of this process alone, in which tests run that reach its line: those that see it refuse first, then the shortest.
Tests that start programs of their own see nothing of it, so the share that is noticed is a lower bound.
"""

from __future__ import annotations

import argparse
import ast
import gc
import os
import random
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from importlib import import_module
from multiprocessing import Pipe
from pathlib import Path
from pkgutil import walk_packages
from types import CodeType, FrameType, FunctionType
from typing import Any

import pytest
from workbench import ROOT

import stseg

ROOMS = ("io", "stseg/config", "stseg/geometry", "stseg/commands", "stseg/tasks")
ESCAPES = ("printable", "escape", "abbreviated", "mask_passwords", "quote")
PREFIXES = ("require", "refuse", "flock", "lockf", "verify", "check")
Reached = tuple[float, set[str]]
"""Seconds of a test, and the `PATH:LINE` that it comes to, with a minus before a line that an exception leaves."""
realpath = cache(os.path.realpath)


@dataclass(frozen=True)
class Mutant:
    """A module without one of its checks."""

    path: str
    line: int
    end: int
    kind: str
    code: CodeType = field(repr=False)

    def __str__(self) -> str:
        return f"{os.path.relpath(self.path, ROOT)}:{self.line} | {self.kind}"

    @property
    def places(self) -> set[str]:
        """Where it is reached, and where an exception leaves it."""
        return {f"{self.path}:{self.line}"} | {f"{self.path}:-{line}" for line in range(self.line, self.end + 1)}

    def tests(self, found: Sequence[Reached]) -> list[int]:
        """The numbers of tests that may notice, in their turn; of a condition only those that see it refuse."""
        at = f"{self.path}:{self.line}"
        own = sorted(
            (len(self.places & places) < 2, seconds, k) for k, (seconds, places) in enumerate(found) if at in places
        )
        return [k for unseen, _, k in own if not (unseen and self.kind == "condition")]


def mutants(path: Path) -> Iterator[Mutant]:
    """All mutants of a module."""
    tree = ast.parse(path.read_text("utf-8"))
    for owner, name, at, kind, other in [found for node in ast.walk(tree) for found in _changes(node)]:
        values = getattr(owner, name)
        whole = values if at is None else values[at]
        for one in ast.walk(other):
            ast.copy_location(one, whole)
        setattr(owner, name, other if at is None else [*values[:at], other, *values[at + 1 :]])
        code = compile(tree, str(path), "exec")
        yield Mutant(str(path.resolve()), whole.lineno, getattr(owner, "end_lineno", whole.lineno), kind, code)
        setattr(owner, name, values)


def _changes(node: ast.AST) -> Iterator[tuple[ast.AST, str, int | None, str, Any]]:
    """The node, its field, the place within, the kind, and what stands there instead."""
    match node:
        case ast.If(body=[*_, ast.Raise()]):
            yield node, "test", None, "condition", ast.Constant(False)
        case ast.Expr(value=ast.Call(func=called)) if ast.unparse(called).split(".")[-1].startswith(PREFIXES):
            yield node, "value", None, "call", ast.Constant(None)
        case ast.FunctionDef(name=name) if name.startswith(("is_", "_is_")):
            for part in ast.walk(node):
                if isinstance(part, ast.BoolOp) and isinstance(part.op, ast.And):
                    yield from ((part, "values", k, "question", ast.Constant(True)) for k in range(len(part.values)))
        case ast.BinOp(op=ast.BitOr(), right=right) if ast.unparse(right).endswith(
            ("O_NOFOLLOW", "O_EXCL", "O_NONBLOCK")
        ):
            yield node, "right", None, "flag", ast.Constant(0)
        case ast.Call(func=called, args=[_]) if ast.unparse(called).split(".")[-1] in ESCAPES:
            yield node, "func", None, "escape", ast.Name("str", ast.Load())


def insert(mutant: Mutant) -> None:
    """Give all functions of the module the mutant's code."""
    found, rest = dict[tuple[str, int], CodeType](), [mutant.code]
    while rest:
        code = rest.pop()
        found[code.co_name, code.co_firstlineno] = code
        rest += [one for one in code.co_consts if isinstance(one, CodeType)]
    for own in [one for one in gc.get_objects() if type(one) is FunctionType]:
        if realpath(own.__code__.co_filename) == mutant.path:
            own.__code__ = found.get((own.__name__, own.__code__.co_firstlineno), own.__code__)


def in_copy(work: Callable[[], Any], seconds: float) -> Any:
    """The answer of a call in a copy of this process; None if it crashes or takes too long."""
    ours, theirs = Pipe(duplex=False)
    if (child := os.fork()) == 0:
        os.setsid()
        sink = os.open(os.devnull, os.O_WRONLY)
        os.dup2(sink, 1), os.dup2(sink, 2)
        try:
            theirs.send(work())
        finally:
            os._exit(0)
    theirs.close()
    try:
        return ours.recv() if ours.poll(seconds) else None
    except EOFError:
        return None
    finally:
        os.killpg(child, signal.SIGKILL)
        os.waitpid(child, 0)


class Round:
    """The tests that pytest collects, run over mutants in place of once."""

    def __init__(self, given: argparse.Namespace) -> None:
        self.given, self.failures = given, 0

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.failures += report.failed

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        for module in walk_packages(stseg.__path__, "stseg."):
            import_module(module.name)
        every = [one for room in ROOMS for path in sorted((ROOT / room).rglob("*.py")) for one in mutants(path)]
        chosen = random.Random(1).sample(every, len(every) // self.given.every)
        places = set[str]().union(*(one.places for one in chosen))
        found = in_copy(lambda: [self.reached(places, *pair) for pair in followed(session.items)], 1e5)
        noticed = 0
        for one in sorted(chosen, key=lambda one: (one.path, one.line)):
            numbers = one.tests(found)[: self.given.most]
            work = partial(self.first_failure, one, [session.items[k] for k in numbers])
            test = in_copy(work, 60 + 3 * sum(found[k][0] for k in numbers))
            noticed += test != ""
            print(f"| {one} | {'hangs or crashes' if test is None else test} |", flush=True)
        print(f"{len(chosen)} of {len(every)} checks were left out; tests noticed {100 * noticed / len(chosen):.1f} %")
        return True

    def reached(self, places: set[str], item: pytest.Item, following: pytest.Item | None) -> Reached:
        """Where a test comes to; nowhere if it fails without mutants."""
        paths, found = {place.rpartition(":")[0] for place in places}, set[str]()

        def line(frame: FrameType, event: str, *_: object) -> Any:
            found.add(f"{realpath(frame.f_code.co_filename)}:{'-' * (event == 'exception')}{frame.f_lineno}")
            return line

        def trace(frame: FrameType, *_: object) -> Any:
            return line if realpath(frame.f_code.co_filename) in paths else None

        before, begun = self.failures, time.monotonic()
        threading.settrace(trace)
        sys.settrace(trace)
        item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
        sys.settrace(None)
        return time.monotonic() - begun, found & places if self.failures == before else set()

    def first_failure(self, mutant: Mutant, items: list[pytest.Item]) -> str:
        """The first test that fails; empty if all pass."""
        insert(mutant)
        for item, following in followed(items):
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
            if self.failures:
                return item.nodeid
        return ""


def followed(items: list[pytest.Item]) -> Iterator[tuple[pytest.Item, pytest.Item | None]]:
    """Each item and the next, which may share its fixtures."""
    return zip(items, [*items[1:], None], strict=False)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tests", nargs="+", help="files or folders of tests")
    parser.add_argument("--every", type=int, default=1, help="one of so many checks, by chance")
    parser.add_argument("--most", type=int, default=20, help="most tests of a mutant")
    given = parser.parse_args()
    sys.exit(pytest.main(["-q", "-p", "no:xdist", "-p", "no:cacheprovider", *given.tests], plugins=[Round(given)]))
