"""A scheduler of Dask and its workers, in processes of their own."""

import re
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from recordings import ENVIRONMENT


class Cluster(NamedTuple):
    address: str
    workers: list[subprocess.Popen[bytes]]


@contextmanager
def started_cluster(tmp_path: Path, folder: Path | None = None) -> Iterator[Cluster]:
    """Two workers, started in a folder by Python's safe path."""
    options: dict[str, Any] = {"env": ENVIRONMENT | {"PYTHONSAFEPATH": "1"}, "cwd": folder}
    command = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1"]
    command += ["--port", "0", "--no-dashboard"]
    log = tmp_path / "scheduler.log"
    with log.open("w") as file:
        started = [subprocess.Popen(command, stderr=file, stdout=file, **options)]
    try:
        deadline = time.monotonic() + 60
        while not (found := re.search(r"tcp://127\.0\.0\.1:\d+", log.read_text())):
            assert time.monotonic() < deadline
            time.sleep(0.1)
        command = [sys.executable, "-m", "distributed.cli.dask_worker", found[0], "--host", "127.0.0.1"]
        command += ["--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory"]
        quiet, folders = subprocess.DEVNULL, [str(tmp_path / f"worker{k}") for k in range(2)]
        started += [subprocess.Popen([*command, folder], stderr=quiet, stdout=quiet, **options) for folder in folders]
        yield Cluster(found[0], started[1:])
    finally:
        for process in started:
            process.kill()
            process.wait()
