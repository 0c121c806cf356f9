"""Print what the prior, the rates and the smoothness do to a cell's energy: a table of docs/the-cut.md.

python tools/energy_table.py
"""

from __future__ import annotations

from dataclasses import replace
from math import log

from stseg.config import Config, GhostConfig, OccupancyConfig

VIEWS = 4


def log_odds(seen: int, prior: float, miss: float, clutter: float) -> float:
    """u of a cell that `seen` of the views see as foreground, whole and sure, and the others as background; nats."""
    hit, blank = log((1 - miss) / clutter), log(miss / (1 - clutter))
    return seen * hit + (VIEWS - seen) * blank + log(prior / (1 - prior))


def row(what: str, occupancy: OccupancyConfig, ghosts: GhostConfig) -> str:
    """One line: u for every number of views."""
    values = (log_odds(k, occupancy.occupied, ghosts.pixel_miss, ghosts.pixel_clutter) for k in range(VIEWS + 1))
    return f"| {what} | " + " | ".join(f"{u:+.1f}" for u in values) + " |"


def main() -> None:
    """Print the table."""
    config = Config()
    occupancy, ghosts = config.occupancy, config.ghosts
    print("| u, nats, where foreground is seen by | " + " | ".join(f"{k} of {VIEWS}" for k in range(VIEWS + 1)) + " |")
    print("|---" * (VIEWS + 2) + "|")
    print(row(f"pi {occupancy.occupied}, m {ghosts.pixel_miss}, b {ghosts.pixel_clutter}", occupancy, ghosts))
    for prior in (0.002, 0.2):
        print(row(f"pi {prior}", replace(occupancy, occupied=prior), ghosts))
    for miss in (0.05, 0.4):
        print(row(f"m {miss}", occupancy, replace(ghosts, pixel_miss=miss)))
    for clutter in (0.01, 0.3):
        print(row(f"b {clutter}", occupancy, replace(ghosts, pixel_clutter=clutter)))


if __name__ == "__main__":
    main()
