"""Run files: the layout is in `layout`, writing in `run_writer`, reading in `run_reader`."""

from stseg.io.runfile.reading.run_reader import Run, read_run, read_trajectory
from stseg.io.runfile.run_writer import RunWriter

__all__ = ["Run", "RunWriter", "read_run", "read_trajectory"]
