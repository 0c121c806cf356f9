"""Faults of the system at every call of a run, and kills at random moments: what was injected, survived and lost.

python tools/faults.py                            each fault at each call that writes, and 100 kills
python tools/faults.py --every 32 --kills 20      at every 32nd write, and at each call of any other kind

A fault is survived if the command ends with a whole output or with one line, and the same command then gives the same
datasets, bit for bit. Anything else is lost.
"""

from __future__ import annotations

import errno
import random
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import astuple, dataclass
from pathlib import Path

from workbench import command_line, write_table

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from fault_driver import Driver
from recordings import assert_same, write_recording

ERRORS = {name: str(getattr(errno, name)) for name in ("ENOSPC", "EIO", "EMFILE", "EACCES")}
FAULTS = {"SIGKILL before the call": "kill", "SIGKILL after it": "kill after", "half is written": "short"} | ERRORS


@dataclass
class Row:
    """A row of the table."""

    fault: str
    injected: int = 0
    ended: int = 0
    refused: int = 0
    killed: int = 0
    lost: int = 0


def at_calls(driver: Driver, whole: Path, calls: Sequence[str], name: str, every: int, scratch: Path) -> Row:
    """One fault at every call; of the writes, at every few."""
    fault, row = FAULTS[name], Row(name)
    writes = [at for at, call in enumerate(calls) if call == "write"]
    others = [] if fault == "short" else [at for at, call in enumerate(calls) if call != "write"]
    for at in sorted(writes[::every] + others):
        output = scratch / f"{fault}-{at}" / "run.h5"
        output.parent.mkdir()
        _count(row, driver, driver.run(output, fault, at).status, output, whole, f"{name}, call {at} ({calls[at]})")
    return row


def at_random(driver: Driver, whole: Path, seconds: float, kills: int, scratch: Path) -> Row:
    """Kills at random moments of one output, which is begun anew once it is whole."""
    row, chance, output = Row("SIGKILL at a random moment"), random.Random(1), scratch / "random" / "run.h5"
    output.parent.mkdir()
    while row.injected < kills:
        status = driver.run(output, "none", -1, after=chance.uniform(0, seconds)).status
        row.killed += status < 0
        row.injected += status < 0
        row.ended += status == 0
        if output.exists() and not Path(f"{output}.segments").exists():
            row.lost += not _is_same(output, whole)
            output.unlink()
    driver.run(output)
    row.lost += not _is_same(output, whole)
    return row


def _count(row: Row, driver: Driver, status: int, output: Path, whole: Path, what: str) -> None:
    row.injected += 1
    row.ended += status == 0
    row.refused += status == 2
    row.killed += status < 0
    was_whole = not output.exists() or _is_same(output, whole)
    if {path.name for path in output.parent.iterdir()} != {"run.h5"}:
        driver.run(output)
    left = {path.name for path in output.parent.iterdir()}
    if status not in (0, 2, -9) or not was_whole or left != {"run.h5"} or not _is_same(output, whole):
        print(f"lost: {what}: status {status}, left {sorted(left)}")
        row.lost += 1


def _is_same(output: Path, whole: Path) -> bool:
    try:
        assert_same(output, whole)
    except (AssertionError, OSError):
        return False
    return True


def main() -> int:
    """The command line; status 1 where something was lost."""
    parser = command_line(__doc__)
    parser.add_argument("--every", type=int, default=1, help="writes from one fault to the next")
    parser.add_argument("--kills", type=int, default=100)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "recording").mkdir()
        (folder / "whole").mkdir()
        driver, whole = Driver(write_recording(folder / "recording"), folder), folder / "whole" / "run.h5"
        driver.run(whole)
        whole.unlink()
        begun = time.monotonic()
        calls = driver.run(whole).calls
        seconds = time.monotonic() - begun
        rows = [at_random(driver, whole, seconds, given.kills, folder)]
        rows += [at_calls(driver, whole, calls, fault, given.every, folder) for fault in FAULTS]
        driver.close()
    print(f"{len(calls)} calls that write: {', '.join(f'{calls.count(kind)} {kind}' for kind in dict.fromkeys(calls))}")
    head = ["fault", "injected", "run ended whole", "one line", "killed", "lost"]
    write_table(given.output / "faults.csv", [head, *map(astuple, rows)])
    return 1 if any(row.lost for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
