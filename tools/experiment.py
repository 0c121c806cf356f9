"""Run one experiment: python tools/experiment.py NAME [options], NAME --help for its options.

ablation    what each special case of detection and tracking earns, off one at a time
compilers   do the ways in which kernels are compiled agree?
errors      whether sizes and appearance err as much as identities take them to
few_views   two and three views of everything: scores, and how many of the points the run takes for wrong
perturbed   mean and spread of scores over runs with perturbed area, grid, cameras and boxes
rig_scale   how well automatic rigs know their scale
same        do two commits give the same bits?
scaling     CPU time of a frame over area, views, people and pixels, with exponents
spoil       what spoiled masks and boxes cost, by kinds, strengths, views and crowds
"""

import importlib
import sys

EXPERIMENTS = ("ablation", "compilers", "errors", "few_views", "perturbed", "rig_scale", "same", "scaling", "spoil")
"""Each is the module `experiments.NAME` with a function `main`, which reads the command line."""


def main() -> None:
    """Run the experiment that the command line names."""
    if len(sys.argv) < 2 or sys.argv[1] not in EXPERIMENTS:
        sys.exit(__doc__)
    name = sys.argv.pop(1)
    sys.argv[0] = f"experiment.py {name}"
    importlib.import_module(f"experiments.{name}").main()


if __name__ == "__main__":
    main()
