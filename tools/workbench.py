"""Where data sets lie and results go, and how the tools run commands there."""

import argparse
import csv
import shlex
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
MADE = ROOT / "build" / "results"
_PROGRAMS = {
    "stseg": [sys.executable, "-c", "import sys; from stseg.commands.main import main; sys.exit(main())"],
    "python": [sys.executable],
}


@dataclass(frozen=True)
class Bench:
    """Folders of data and of work; runs commands written with $DATA and $WORK."""

    data: Path
    work: Path

    @classmethod
    def of(cls, asked: argparse.Namespace) -> "Bench":
        """The folders of a command line."""
        return cls(asked.data.resolve(), asked.work.resolve())

    def path(self, text: str) -> Path:
        """A path written with $DATA or $WORK."""
        return Path(self._filled(text))

    def do(self, command: str, folder: Path = ROOT, environment: Mapping[str, str] | None = None) -> str:
        """Run a command in a folder and return what it printed; stop where it fails."""
        print(f"$ {command}", flush=True)
        program, *arguments = shlex.split(command)
        words = [*_PROGRAMS[program], *(word for argument in arguments for word in self._words(argument))]
        process = subprocess.run(words, stdout=subprocess.PIPE, text=True, cwd=folder, env=environment, check=False)
        if process.returncode:
            sys.exit(f"exit status {process.returncode} of: {command}")
        return process.stdout

    def _filled(self, text: str) -> str:
        return text.replace("$DATA", str(self.data)).replace("$WORK", str(self.work))

    def _words(self, argument: str) -> list[str]:
        """The words that a shell would make of an argument."""
        filled = self._filled(argument)
        if "?" not in argument:
            return [filled]
        return sorted(str(path) for path in Path("/").glob(filled.lstrip("/"))) or [filled]


def command_line(text: str | None, **numbers: int) -> argparse.ArgumentParser:
    """A command line with its help, the folders that most tools work with, and options of whole numbers."""
    parser = argparse.ArgumentParser(description=text, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=ROOT / "../shared/data", help="folder of data sets")
    parser.add_argument("--work", type=Path, default=MADE, help="folder for what is made")
    parser.add_argument("-o", "--output", type=Path, default=MADE, metavar="FOLDER", help="of the tables")
    for option, default in numbers.items():
        parser.add_argument(f"--{option}", type=int, default=default, help=f"{default} if not given")
    return parser


def in_processes(work: Callable[..., Any], tasks: Iterable[Sequence[object]], jobs: int) -> Iterator[Any]:
    """What `work` returns of each task's arguments, in their order, by so many fresh processes."""
    with ProcessPoolExecutor(jobs, get_context("spawn")) as pool:
        yield from pool.map(work, *zip(*tasks, strict=True))


def write_table(path: Path, rows: Iterable[Iterable[object]]) -> None:
    """Write a table of results."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)


def commit() -> str:
    """The commit that is checked out, `+` behind it where files differ from it."""
    head = _git("rev-parse", "--short", "HEAD")
    return f"{head}+" if _git("status", "--porcelain", "--untracked-files=no", "--", "stseg", "io") else head


def checkout(base: str, work: Path) -> Path:
    """Files of a commit, under the folder of work."""
    folder = work / "base" / base
    if not folder.exists():
        folder.mkdir(parents=True)
        archive = subprocess.run(["git", "archive", base], cwd=ROOT, stdout=subprocess.PIPE, check=True)
        subprocess.run(["tar", "-x", "-C", str(folder)], input=archive.stdout, check=True)
    return folder


def _git(*words: str) -> str:
    return subprocess.run(["git", *words], cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True).stdout.strip()
