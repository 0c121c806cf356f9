"""Fuzzing of all parsers and readers for as long as is asked for.

python tools/fuzzing.py --minutes 60          all targets for an hour in all
python tools/fuzzing.py --target run.h5       one of them

Failures are printed with their seeds; the first file of each is kept in the folder `fuzz-failures`.
"""

import argparse
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from fuzz.runner import content, fuzz
from fuzz.targets import TARGETS, Target


def main() -> int:
    """The command line; status 1 where something failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--target", action="append", help="only this one; may be given several times")
    parser.add_argument("--first", action="store_true", help="end at the first failure")
    given = parser.parse_args()
    targets = [target for target in TARGETS if not given.target or target.name in given.target]
    failed = 0
    for target in targets:
        until = time.monotonic() + 60 * given.minutes / len(targets)
        count, failures = fuzz(target, given.seed, until, sys.maxsize - given.seed, given.first)
        failed += len(failures)
        print(f"{target.name:20} {count:8} files, {len(failures)} failures", flush=True)
        for reason in dict.fromkeys(failure.reason for failure in failures):
            seeds = [failure.seed for failure in failures if failure.reason == reason]
            print(f"    {reason}: seeds {seeds[:5]}{' ...' if len(seeds) > 5 else ''}", flush=True)
            _keep(target, seeds[0])
    return 1 if failed else 0


def _keep(target: Target, seed: int) -> None:
    folder = Path("fuzz-failures")
    folder.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        data = content(target, target.valid(Path(name)), seed)
    (folder / f"{Path(target.name).stem}-{seed}{target.suffix}").write_bytes(data)


if __name__ == "__main__":
    sys.exit(main())
