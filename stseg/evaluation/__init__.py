"""Scores of ground tracks against truth (METHODS section 10).

Five ideas, a file each: `sequence` lines truth and tracks up frame by frame and settles who is not to be judged,
`matching` pairs people with tracks, and from the pairs come CLEAR (`clear`), IDF1 (`identity`) and HOTA (`hota`).
`scores` asks them all.
"""

from stseg.evaluation.scores import Scores, evaluate

__all__ = ["Scores", "evaluate"]
