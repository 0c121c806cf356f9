"""`stseg correct`: a run with the identities that a person has corrected."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from stseg.errors import ConfigError
from stseg.identities.review.corrections import ACTIONS, Answer
from stseg.io.answers import read_answers
from stseg.io.outputs.whole_files import require_new
from stseg.io.runfile.corrected import write_corrected
from stseg.io.runfile.runs import read_run
from stseg.io.untrusted.bounded_files import read_text
from stseg.tasks.correction import corrected_tracks


def correct(
    run_file: Path,
    answers: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"], metavar="CORRECTED.h5")],
    overwrite: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Write a run file with corrected identities; the run itself stays as it is.

    Example: stseg correct night.h5 answers.csv -o corrected.h5

    ANSWERS is a CSV file with the columns action,frame,id,other,name, written by hand or by the page of stseg review.
    Ids and frames are those of the run. Actions:

    **swap**: from frame on, id and other exchange identities. **join**: other continues id. **split**: from frame on,
    id is another person. **delete**: id is no person (from frame on, if given). **name**: the person of id is called
    name. **keep**: nothing changes.

    All answers hold together; one that contradicts another is refused. Identities of the whole run are solved again,
    with the answers as facts: a few of them decide the rest. A corrected run can be reviewed and corrected again; what
    was answered before still holds. In a run of a tracker whose identities are final, ids are only exchanged. Evidence
    is not changed; the answers are kept in the file's provenance.

    Parameters
    ----------
    run_file
        A run file (.h5).
    answers
        The answers.
    output
        The run file to write.
    overwrite
        Replace the file if it exists.
    """
    require_new(output, overwrite)
    if output.exists() and run_file.exists() and output.samefile(run_file):
        raise ConfigError("command line", "--output", "the run file itself", "another file")
    run, rows = read_run(run_file), read_answers(answers, ACTIONS)
    given = [Answer(r.place, r.action, r.track, r.other, r.frame, r.name) for r in rows]
    found = corrected_tracks(run, given)
    text = read_text(answers)
    write_corrected(run_file, output, found.tracks, found.answered, found.new_ids, found.names, text, overwrite)
    changed = sum(row.action != "keep" for row in rows)
    print(f"wrote {output}: {len(rows)} answers, {changed} changes; {len(read_run(output).tracks)} tracks")
