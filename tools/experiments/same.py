"""Do this checkout and another commit give the same bits? Runs both on the same recordings and compares the run files.

    python tools/experiment.py same BASE --work FOLDER             every recording, whole
    python tools/experiment.py same BASE --work FOLDER --quick     the first frames of each, in about two minutes
    python tools/experiment.py same BASE --work FOLDER --sets uu4,cmc1

Inputs (rigs, films) are made by BASE. Every dataset and every column of every table is compared, /timings and
/provenance excepted. Digests of a commit are kept in FOLDER, so BASE is run once. The exit status is 1 where a bit
differs.
"""

import hashlib
import json
import os
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from result_sets import SETS
from workbench import ROOT, Bench, checkout, command_line

_UNCOMPARED = ("timings", "provenance")
"""Parts of a run file in which equal runs differ."""


@dataclass(frozen=True)
class Recorded:
    """A run that is compared: its rig file, written with $WORK; frames A:B of a whole and a quick comparison; further
    options of `stseg run`; and commands that make the rig file where it is not there."""

    name: str
    rig: str
    frames: str
    quick: str
    options: str = ""
    inputs: tuple[str, ...] = ()


def _of_results(name: str, frames: str, quick: str, options: str = "", suffix: str = "") -> Recorded:
    """A run of one of the sets of the results table."""
    one = SETS[name]
    inputs = (*(() if one.film is None else (one.film,)), *one.prepare)
    return Recorded(name + suffix, one.rig, frames, quick, options, inputs)


_FILM = "stseg simulate $WORK/film --scene easy --cameras 4 --seconds 80 --frame-rate 15 --size 720,576"
_ALL = (
    _of_results("uu4", "0:272", "0:40"),
    _of_results("uu4_colour", "0:136", "0:24"),
    _of_results("cmc1", "0:261", "0:60"),
    _of_results("cmc2", "0:261", "0:50"),
    _of_results("cmc2_fairmot_features", "0:261", "0:40"),
    _of_results("wildtrack", "0:60", "0:6"),
    _of_results("easy", "0:250", "0:30"),
    _of_results("dense4", "0:100", "0:12"),
    _of_results("dense_masks", "0:40", "0:6"),
    _of_results("pom", "0:30", "0:30"),
    Recorded("film", "$WORK/film/rig.toml", "0:1200", "0:40", inputs=(_FILM,)),
    _of_results("uu4", "0:60", "0:20", "--tracker kalman", "_kalman"),
    _of_results("uu4_colour", "0:30", "0:10", "--tracker particles", "_particles"),
    _of_results("uu4_colour", "0:30", "0:10", "--tracker belief", "_belief"),
    _of_results("uu4", "0:60", "0:20", "--tracker frames", "_frames"),
)


def digests(run_file: Path) -> dict[str, str]:
    """Digest of every dataset and table column of a run file, by name."""
    found: dict[str, str] = {}

    def add(name: str, item: h5py.Dataset | h5py.Group) -> None:
        if name.split("/")[0] in _UNCOMPARED or not isinstance(item, h5py.Dataset):
            return
        values = item[()]
        columns = {name: values}
        if isinstance(values, np.ndarray) and values.dtype.names:
            columns = {f"{name}.{column}": values[column] for column in values.dtype.names}
        for column, array in columns.items():
            content = np.ascontiguousarray(array)
            if content.dtype.kind == "O":
                content = np.array([str(one) for one in content.ravel()])
            digest = hashlib.sha256(f"{content.dtype.str}{content.shape}".encode())
            digest.update(content.tobytes())
            found[column] = digest.hexdigest()[:16]

    with h5py.File(run_file) as file:
        file.visititems(add)
    return found


def command(folder: Path, words: str, bench: Bench) -> None:
    """Run a command by the code of a checkout."""
    bench.do(words, folder, os.environ | {"PYTHONPATH": str(folder)})


def run(one: Recorded, folder: Path, frames: str, bench: Bench, output: Path) -> dict[str, str]:
    """Track a recording by the code of a checkout; the digests of the run file."""
    words = f"stseg run {one.rig} -o {output} --frames {frames} --workers 1 --overwrite {one.options}"
    command(folder, words, bench)
    found = digests(output)
    output.unlink()
    return found


def demo(folder: Path, bench: Bench, output: Path) -> dict[str, str]:
    """Digests of the run file of `stseg demo`."""
    shutil.rmtree(output, ignore_errors=True)
    command(folder, f"stseg demo {output}", bench)
    found = digests(next(output.glob("*.h5")))
    shutil.rmtree(output)
    return found


def differences(before: dict[str, str], now: dict[str, str]) -> list[str]:
    """Names of datasets and columns that differ."""
    return sorted(name for name in before.keys() | now.keys() if before.get(name) != now.get(name))


def main() -> None:
    """Compare, a line for each recording."""
    parser = command_line(__doc__, jobs=2)
    parser.add_argument("base", help="the commit to compare with")
    parser.add_argument("--sets", default="", help="names, by comma; all if not given")
    parser.add_argument("--quick", action="store_true", help="the first frames of each recording, without the demo")
    asked = parser.parse_args()
    base = subprocess.run(["git", "rev-parse", asked.base], cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
    sha = base.stdout.strip()[:12]
    bench = Bench.of(asked)
    folder = checkout(sha, bench.work)
    names = [name for name in asked.sets.split(",") if name]
    chosen = [one for one in _ALL if not names or one.name in names]
    for one in chosen:
        if not bench.path(one.rig).exists():
            for words in one.inputs:
                command(folder, words, bench)

    def compared(name: str) -> tuple[str, list[str]]:
        kept = bench.work / "base" / f"{sha}_{name}{'_quick' if asked.quick else ''}.json"
        output = bench.work / f"same_{os.getpid()}_{name}"

        def measured(source: Path) -> dict[str, str]:
            if name == "demo":
                return demo(source, bench, output)
            one = next(one for one in _ALL if one.name == name)
            return run(one, source, one.quick if asked.quick else one.frames, bench, output.with_suffix(".h5"))

        if not kept.exists():
            kept.write_text(json.dumps(measured(folder)), encoding="utf-8")
        return name, differences(json.loads(kept.read_text(encoding="utf-8")), measured(ROOT))

    wanted = [one.name for one in chosen]
    if not asked.quick and (not names or "demo" in names):
        wanted.append("demo")
    failed = False
    with ThreadPoolExecutor(asked.jobs) as pool:
        for name, differing in pool.map(compared, wanted):
            print(f"{name}: {'same bits' if not differing else 'differs: ' + ', '.join(differing)}", flush=True)
            failed |= bool(differing)
    sys.exit(1 if failed else 0)
