"""Measure stseg on every set at hand: docs/results/results.csv, and the table of docs/development/results.md from it.

    python tools/results.py [--sets uu4,cmc1,...] [--variants cut,frames,...] [--jobs 2] [--data ../shared/data]
        [--work FOLDER]

Makes rig files, runs and scores, all through the command line of `stseg`. All rows of the table are of one commit:
a measurement of every set begins with an empty table, one of some sets replaces their rows where the commit is that of
the table. `--sets none` writes the page from the stored figures. Rendered scenes in WORK are used again: remove WORK
after a change to the simulator.
"""

import csv
import json
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor

from measure import prepare
from result_sets import SETS, VARIANTS, ResultSet, Variant
from workbench import ROOT, Bench, command_line, commit

from stseg.io.runfile.runs import read_run

STORE, PAGE = ROOT / "docs" / "results" / "results.csv", ROOT / "docs" / "development" / "results.md"
ABLATION = STORE.with_name("ablation.csv")
_UNCHANGED = "+0.00 ± 0.00; +0.00 ± 0.00"
SCORES = {
    "MODA": "MODA",
    "MODP": "MODP",
    "precision": "precision",
    "recall": "recall",
    "MOTA": "MOTA",
    "IDF1": "IDF1",
    "HOTA": "HOTA",
    "switches": "IDSW",
    "fragments": "Frag",
    "false_tracks": "false_tracks",
}
"""Columns of the table, and their names in the output of `stseg evaluate --json`."""
COLUMNS = ("set", "variant", "frames", *SCORES, "tracks", "error_m", "commit", "run", "evaluate")
_OTHERS = ("kalman", "particles", "belief")
"""Baselines that stand beside the trackers on the page."""

Row = Mapping[str, str]


def measured(one: ResultSet, variant: Variant, bench: Bench) -> Row:
    """Run and score one row."""
    command = one.run_command(variant)
    bench.do(f"{command} --overwrite")
    run = read_run(bench.path(one.run_file(variant)))
    row = {"set": one.name, "variant": variant.name, "frames": one.frames, "run": command, "commit": commit()}
    row["tracks"] = str(len(run.tracks))
    if one.truth is not None:
        row["evaluate"] = one.score_command(variant)
        scores = json.loads(bench.do(f"{row['evaluate']} --json"))
        row |= {column: _text(scores[name]) for column, name in SCORES.items()}
        row["error_m"] = _text(scores["location_error_m"]["mean"])
    return row


def _text(value: float | None) -> str:
    return "" if value is None else str(value)


def stored() -> dict[tuple[str, str], Row]:
    """The rows of the table by set and variant."""
    with STORE.open(newline="", encoding="utf-8") as file:
        return {(row["set"], row["variant"]): row for row in csv.DictReader(file)}


def publish(rows: Mapping[tuple[str, str], Row]) -> None:
    """Write the table, and the page's part that shows it."""
    with STORE.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS, restval="", lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows[key] for key in sorted(rows))
    PAGE.write_text(ablation(page(PAGE.read_text(encoding="utf-8"), rows)), encoding="utf-8")


def page(text: str, rows: Mapping[tuple[str, str], Row]) -> str:
    """The page with the table of all sets and trackers between its marks."""
    head = ["set", "input", "frames", "cut", "switches", "error m", "frames only", *_OTHERS]
    lines = [f"| {' | '.join(head)} |", f"|{' --- |' * 3}{' --: |' * (len(head) - 3)}"]
    for one in SETS.values():
        row = rows.get((one.name, "cut"))
        if row is not None:
            words = "; ".join(filter(None, (one.foreground, f"{one.views} views", one.remark)))
            others = [_scores(rows.get((one.name, name))) for name in ("frames", *_OTHERS)]
            cells = [_scores(row), row.get("switches") or "-", row.get("error_m") or "-", *others]
            lines.append(f"| {' | '.join([f'`{one.name}`', words, row['frames'], *cells])} |")
    return _filled(text, "table", lines)


def ablation(text: str) -> str:
    """The page with the table of what mechanisms earn, MODA and IDF1 by mechanism and set, between its marks."""
    with ABLATION.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    sets = list(dict.fromkeys(row["set"] for row in rows))
    cells = {(row["mechanism"], row["set"]): f"{row['moda']}; {row['idf1']}" for row in rows}
    lines = [f"| without | {' | '.join(f'`{name}`' for name in sets)} |", f"| ---{' | --:' * len(sets)} |"]
    lines += [
        f"| {mechanism} | {' | '.join(cells.get((mechanism, name), '-') for name in sets)} |".replace(_UNCHANGED, "0")
        for mechanism in dict.fromkeys(row["mechanism"] for row in rows)
    ]
    return _filled(text, "ablation", lines)


def _filled(text: str, name: str, lines: Sequence[str]) -> str:
    """The text with the lines between the marks of a name."""
    begin, end = f"<!-- {name} -->\n", f"\n<!-- end of {name} -->"
    return text.partition(begin)[0] + begin + "\n".join(lines) + end + text.partition(end)[2]


def _scores(row: Row | None) -> str:
    """MODA / IDF1."""
    return f"{float(row['MODA']):.1f} / {float(row['IDF1']):.1f}" if row and row.get("MODA") else "-"


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure the sets that are asked for, then write the page."""
    parser = command_line(__doc__, jobs=1)
    parser.add_argument("--sets", default=",".join(SETS), help="names of sets; none for the page alone")
    parser.add_argument("--variants", default=",".join(VARIANTS), help=f"of {', '.join(VARIANTS)}")
    asked = parser.parse_args(arguments)
    bench = Bench.of(asked)
    names = [] if asked.sets == "none" else asked.sets.split(",")
    for chosen, known in ((names, SETS), (asked.variants.split(","), VARIANTS)):
        unknown = [name for name in chosen if name not in known]
        if unknown:
            sys.exit(f"results.py: {', '.join(unknown)}: expected names among {', '.join(known)}")
    rows = {key: row for key, row in stored().items() if row["commit"] == commit() or not names}
    for name in names:
        prepare(SETS[name], bench)
        variants = [variant for variant in SETS[name].variants if variant.name in asked.variants.split(",")]
        with ThreadPoolExecutor(asked.jobs) as pool:
            for row in pool.map(lambda variant, one=SETS[name]: measured(one, variant, bench), variants):
                rows[row["set"], row["variant"]] = row
                publish(rows)
    publish(rows)


if __name__ == "__main__":
    main()
