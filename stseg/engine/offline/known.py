"""People of an earlier run, by whom those of a later one are recognised: `stseg run --known`."""

from hashlib import blake2b
from pathlib import Path

import numpy as np

from stseg.arrays import Rows, columns, some_columns
from stseg.config import Config
from stseg.errors import ConfigError, FormatError
from stseg.identities.evidence.returns import known_people
from stseg.io.runfile.runs import Run, read_run
from stseg.io.untrusted import limits

_LAST_ID = limits.FRAMES // 2
"""Greatest id of a known person."""
_PLACE = columns("frame:<i8 raw_x:<f8 raw_y:<f8")


def read_known(path: Path, config: Config) -> Rows:
    """The people of a run file and those whom it knew from earlier ones, KNOWN_PERSON (n,).

    Raises
    ------
    ConfigError
        Where the configuration recognises nobody.
    FormatError
        Where the file is no run file, or one without the rows that tell of its people.
    """
    if config.tracking.return_probability == 1:
        wanted = "tracking.return_probability below 1 with it, 0.99 for instance"
        raise ConfigError("--known", "", "that alone", wanted)
    run = read_run(path)
    if not len(run.committed):
        raise FormatError(path, "/committed", "no rows", "those of a run of the tracker cut or frames")
    people_of_run = known_people(rows_with_ids(run), run.appearance)
    earlier = run.known_people[~np.isin(run.known_people["id"], people_of_run["id"])]
    people = np.concatenate([earlier, people_of_run])
    if (greatest := people["id"].max(initial=0)) > _LAST_ID:
        raise FormatError(
            path, "/tracks, id", str(greatest), f"ids up to {_LAST_ID}, so that there are some for others"
        )
    return people


def rows_with_ids(run: Run) -> Rows:
    """Committed rows with the ids of the run's tracks, 0 for none; rows of tracks keep the raw places."""
    rows = run.committed.copy()
    rows["id"] = 0
    tracked, committed = (some_columns(table, _PLACE) for table in (run.trajectory, run.committed))
    _, index, row = np.intersect1d(tracked, committed, return_indices=True)
    rows["id"][row] = run.trajectory["id"][index]
    return rows


def digest(people: Rows) -> str:
    """Digest of known people, in words."""
    return f"{len(people)} people, {blake2b(people.tobytes(), digest_size=8).hexdigest()}"
