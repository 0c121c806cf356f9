"""`stseg correct`: a run with the identities that a person has corrected."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from stseg.commands.options import Overwrite
from stseg.commands.terminal.counts import counted
from stseg.tasks import correction


def correct(
    run_file: Path,
    answers: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"], metavar="CORRECTED.h5")],
    overwrite: Overwrite = False,
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
    """
    found = correction.correct(run_file, answers, output, overwrite=overwrite)
    changed = sum(answer.action != "keep" for answer in found.answers)
    counts = f"{counted(len(found.answers), 'answer')}, {counted(changed, 'change')}"
    print(f"wrote {output}: {counts}; {counted(len(found.run.tracks), 'track')}")
