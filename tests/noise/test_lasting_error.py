"""Errors that last: what is found of them, and what the rows of a person hold."""

import numpy as np
import pytest
from scipy.signal import lfilter

from stseg.arrays import Floats, Ints
from stseg.noise.lasting_error import LastingError, constant_errors

RATE = 8.0
PRIOR = LastingError(np.array([0.0]), np.array([0.05**2]), np.array([0.5]))


def recording(
    white: float, lasting: float, seconds: float, people: int = 400, frames: int = 160
) -> tuple[Floats, Ints]:
    """Values of people (person, frame), and their frames: people differ by 0.1."""
    rng, kept = np.random.default_rng(4), np.exp(-1 / (seconds * RATE))
    steps = np.sqrt(1 - kept**2) * rng.normal(size=(people, frames + 400))
    alike = lfilter([1.0], [1.0, -kept], steps)[:, 400:]
    values = lasting * alike + white * rng.normal(size=alike.shape) + rng.normal(1.7, 0.1, (people, 1))
    return values, np.tile(np.arange(frames), people)


def found(values: Floats, frame: Ints) -> LastingError:
    tracklets = np.split(np.arange(values.size), len(values))
    return constant_errors(values.reshape(1, -1), frame, tracklets, PRIOR, RATE)


@pytest.mark.parametrize(
    ("white", "lasting", "seconds"), [(0.03, 0.0, 1.0), (0.02, 0.05, 0.4), (0.02, 0.05, 2.0), (0.01, 0.03, 5.0)]
)
def test_differences_of_halves_are_as_large_as_claimed(white: float, lasting: float, seconds: float) -> None:
    """Between means of 5 s of one person, 5 s apart: their variance is claimed, and that of two people is not."""
    values, frame = recording(white, lasting, seconds)
    errors = found(values, frame)
    assert errors.variance[0] == pytest.approx(white**2 + lasting**2, rel=0.25)
    early, late, both = np.arange(40), np.arange(80, 120), np.r_[0:40, 80:120]
    # The mean of both spans is half the sum of theirs, so the variance of a difference follows from three means.
    apart, joint = (errors.mean_variance(span, RATE)[0] for span in (early, both))
    claimed = 4 * (apart - joint)
    difference = values[:, early].mean(1) - values[:, late].mean(1)
    assert (difference**2).mean() / claimed == pytest.approx(1.0, abs=0.2)
    of_two = values[1:, early].mean(1) - values[:-1, late].mean(1)
    assert (of_two**2).mean() / claimed > 3


def test_rows_of_a_long_time_count_as_their_mean_errs() -> None:
    errors = LastingError(np.array([0.02**2]), np.array([0.05**2]), np.array([1.5]))
    frames = np.arange(4000)
    of_mean = errors.mean_variance(frames, RATE)
    np.testing.assert_allclose(errors.row_variance(RATE) / len(frames), of_mean, rtol=0.02)
    assert errors.row_variance(RATE)[0] > 10 * errors.variance[0]


def test_a_short_recording_keeps_the_prior() -> None:
    values, frame = recording(0.02, 0.0, 1.0, people=1, frames=5)
    errors = found(values, frame)
    assert errors.variance[0] > 0.1 * PRIOR.variance[0]
    assert np.isfinite(errors.row_variance(RATE)).all()


def test_people_who_sit_down_are_no_errors() -> None:
    values, frame = recording(0.02, 0.04, 1.0, people=60)
    before = found(values, frame)
    values[:2, 80:] -= 0.4
    assert found(values, frame).row_variance(RATE)[0] < 1.5 * before.row_variance(RATE)[0]


def test_one_long_tracklet_says_little_of_far_lags() -> None:
    """Most tracklets are short; in the only long one somebody rises from a chair."""
    values, frame = recording(0.02, 0.03, 0.6, people=151)
    values[0, 80:] += 0.5
    short = np.split(np.arange(160, values.size), 150)
    tracklets = [np.arange(160), *(rows[:16] for rows in short)]
    errors = constant_errors(values.reshape(1, -1), frame, tracklets, PRIOR, RATE)
    assert errors.variance[0] < 2 * (0.02**2 + 0.03**2)
