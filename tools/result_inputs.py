"""Bring what public data sets hold into files that `stseg` reads.

    python tools/result_inputs.py KIND SOURCE OUTPUT

cmc-truth: GT_CMC1_WORLD_CENTROID.txt to a table. wildtrack-truth: annotations_positions to a table. wildtrack-boxes:
annotations_positions to a folder of tables, one a view.
"""

from __future__ import annotations

import sys
from pathlib import Path

from datasets import cmc_truth, wildtrack_annotated_boxes, wildtrack_truth, write_truth_csv


def main(kind: str, source: Path, output: Path) -> None:
    """Make one of them."""
    if kind == "cmc-truth":
        write_truth_csv(output, cmc_truth(source), overwrite=True)
    elif kind == "wildtrack-truth":
        write_truth_csv(output, wildtrack_truth(source), overwrite=True)
    elif kind == "wildtrack-boxes":
        wildtrack_annotated_boxes(source, output)
    else:
        sys.exit(f"result_inputs.py: {kind!r}: expected cmc-truth, wildtrack-truth or wildtrack-boxes")


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    main(sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3]))
