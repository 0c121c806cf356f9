"""Faults of the system at every call of a run, and kills of every command: what was injected, survived and lost.

python tools/faults.py                            each fault at each call that writes, and 23 kills of each command
python tools/faults.py --every 32 --kills 5       at every 32nd call

A fault is survived if the command ends with a whole output or with one line, no process of it lives five seconds later,
and the same command then gives the same datasets, bit for bit. Anything else is lost.
"""

import errno
import os
import random
import shutil
import sys
import tempfile
import time
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from workbench import command_line, write_table

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from arrivals import arrive, write_pieces
from cluster import started_cluster
from fault_driver import SHORT, Driver
from recordings import OPTIONS, assert_same

ERRORS = {name: str(getattr(errno, name)) for name in ("ENOSPC", "EIO", "EMFILE", "EACCES")}
FAULTS = {"SIGKILL before the call": "kill", "SIGKILL after it": "kill after", "half is written": "short"} | ERRORS
ENDS = {0: "run ended whole", 2: "one line"}
KINDS = ("injected", *ENDS.values(), "killed", "lost")
CORNERS = (20.0, 44.0, 40.6, 23.4), (60.0, 60.0, 49.7, 49.7), (-1, 1, 1, -1), (-1, -1, 1, 1)


def commands(folder: Path, rig: Path, address: str) -> dict[str, tuple[str, str]]:
    """The commands that are killed: their words but for the output, and its name."""
    short, run = f"run {rig} {' '.join([*OPTIONS, *SHORT])}", folder / "run" / "whole" / "run.h5"
    (folder / "answers.csv").write_text("action,frame,id,other,name\nname,,1,,Ada\n")
    (folder / "points.csv").write_text("camera,u,v,x,y\n" + "".join(map("a,{},{},{},{}\n".format, *CORNERS)))
    points = f"{folder / 'points.csv'} --size 64,48 --area=-2,-2,2,2 --frame-rate 5 --source-pattern {{name}}.avi"
    return {
        "run": (f"{short} --workers 1", "run.h5"),
        "run by two workers": (f"{short} --workers 2", "run.h5"),
        "run by a cluster": (f"{short} --scheduler {address}", "run.h5"),
        "run --follow": (f"run {rig} --follow --frames 0:12", "run.h5"),
        "correct": (f"correct {run} {folder / 'answers.csv'} --overwrite", "corrected.h5"),
        "report": (f"report {run} --overwrite", "report.html"),
        "export": (f"export {run} --to sqlite --overwrite", "tracks.sqlite"),
        "labels": (f"labels {run} --overwrite", "images"),
        "calibrate": (f"calibrate points {points} --overwrite", "points.toml"),
    }


@dataclass
class Trials:
    """A command: its words, its output where nothing disturbs it, and the folder of the others."""

    driver: Driver
    words: list[str]
    whole: Path
    folder: Path

    def disturb(self, row: Counter[str], fault: str, at: int = -1, after: float | None = None) -> None:
        """Disturb it once, and then no more; count how it ended."""
        output, again = self.folder / self.whole.name, "--overwrite" in self.words
        done = self.driver.run(output, fault, at, after, self.words)
        is_lost = done.status not in (0, 2, -9) or _lives(self.folder)
        is_lost |= output.is_file() and not _is_same(output, self.whole)
        for part in self.folder.rglob("*.part"):
            os.utime(part, (0, 0))  # parts of killed commands are removed after an hour
        if again or self.left() != {output.name}:
            self.driver.run(output, words=self.words)
        is_lost |= self.left() != {output.name} or not _is_same(output, self.whole)
        row.update(["injected", ENDS.get(done.status, "killed"), *["lost"] * is_lost])
        if is_lost:
            print(f"lost: call {at}, {after} s, left {self.left()}: {done.status}: {done.messages[-500:]}", flush=True)
        if is_lost or not again:
            shutil.rmtree(self.folder)
            self.folder.mkdir()

    def left(self) -> set[str]:
        """Names in the folder, but for the table that a run writes while it follows."""
        return {path.name for path in self.folder.iterdir() if not path.name.endswith(".live.csv")}


def _lives(folder: Path) -> bool:
    """Whether a process of a trial in a folder is there five seconds after its end."""
    deadline = time.monotonic() + 5
    while any(f"STSEG_TRIAL={folder}\0" in _text(path) for path in Path("/proc").glob("[0-9]*/environ")):
        if time.monotonic() > deadline:
            return True
        time.sleep(0.1)
    return False


def _text(path: Path) -> str:
    with suppress(OSError):
        return path.read_text(errors="replace")
    return ""


def _is_same(output: Path, whole: Path) -> bool:
    try:
        if output.suffix == ".h5":
            assert_same(output, whole)
            return True
        if output.is_dir():
            return all(_is_same(path, whole / path.relative_to(output)) for path in output.rglob("*.*"))
        return output.read_bytes() == whole.read_bytes()
    except (AssertionError, OSError):
        return False


def main() -> int:
    """The command line; status 1 where something was lost."""
    parser = command_line(__doc__)
    parser.add_argument("--every", type=int, default=1, help="calls from one fault to the next")
    parser.add_argument("--kills", type=int, default=23, help="of each command; every fifth while it publishes")
    given, rows, chance = parser.parse_args(), dict[str, Counter[str]](), random.Random(1)
    with tempfile.TemporaryDirectory() as name, started_cluster(Path(name)) as cluster:
        folder = Path(name)
        rig = write_pieces(folder, empty=True)
        arrive(folder, 1, 2)
        driver, of_run = Driver(rig, folder), list[tuple[Trials, int]]()
        for what, (words, output) in commands(folder, rig, cluster.address).items():
            one = Trials(driver, words.split(), folder / what / "whole" / output, folder / what / "again")
            one.whole.parent.mkdir(parents=True)
            one.folder.mkdir()
            begun = time.monotonic()
            first, seconds = driver.run(one.whole, words=one.words), time.monotonic() - begun
            of_run.append((one, len(first.calls)))
            last = max((at for at, call in enumerate(first.calls) if call == "write"), default=0)
            row = rows[f"SIGKILL of {what}"] = Counter()
            for number in range(given.kills):
                if number % 5 == 0:
                    one.disturb(row, "kill after", chance.randrange(last, len(first.calls)))
                else:
                    one.disturb(row, "none", after=chance.uniform(0, seconds))
            print(what, dict(row), flush=True)
        for fault, code in FAULTS.items():
            one, count = of_run[0]
            row = rows[fault] = Counter()
            for at in range(chance.randrange(given.every), count, given.every):
                one.disturb(row, code, at)
            print(fault, dict(row), flush=True)
        driver.close()
    table = [[fault, *(row[kind] for kind in KINDS)] for fault, row in rows.items()]
    write_table(given.output / "faults.csv", [["fault", *KINDS], *table])
    return 1 if any(row["lost"] for row in rows.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
