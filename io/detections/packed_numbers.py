"""Numbers of a text file in memory: a day of boxes has millions, each written with a few decimals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import AnyArray, Flags, Floats, Ints

_MOST_DECIMALS = 6
_WHOLE = (np.dtype(np.int16), np.dtype(np.int32))
_ROWS_AT_ONCE = 1 << 16


@dataclass(frozen=True)
class PackedNumbers:
    """Numbers as whole multiples of a decimal unit, where that gives the same bits.

    The quotient of two whole numbers is rounded as the text of the decimal fraction is, so it is the same number.
    """

    whole: AnyArray
    """int16 or int32 (n, ...), the lowest for -0; float64, the numbers themselves, where no unit fits."""
    units: float
    """In 1, a power of ten."""

    @classmethod
    def of(cls, values: Floats) -> PackedNumbers:
        """Numbers float64 (n, ...) by the largest unit, in the smallest type, that fits."""
        parts = [slice(start, start + _ROWS_AT_ONCE) for start in range(0, len(values), _ROWS_AT_ONCE)]
        for decimals in range(_MOST_DECIMALS + 1):
            units, most = 10.0**decimals, np.abs(values).max(initial=0.0)
            kind = next((one for one in _WHOLE if most * units < np.iinfo(one).max), None)
            if kind is None:
                break
            whole = np.empty(values.shape, kind)
            if all(_fill(whole[part], values[part], units) for part in parts):
                return cls(whole, units)
        return cls(values, 1.0)

    def __len__(self) -> int:
        return len(self.whole)

    def __getitem__(self, chosen: slice | int) -> Floats:
        """The numbers of some rows, float64."""
        return _decimals(self.whole[chosen], self.units)


Numbers = Floats | PackedNumbers
"""Numbers whose rows are float64."""


def packed(values: Numbers) -> PackedNumbers:
    """Numbers as they take the least memory."""
    return values if isinstance(values, PackedNumbers) else PackedNumbers.of(values)


def rows_of(values: Numbers, chosen: Flags | Ints) -> Numbers:
    """Some rows, by index or mask, packed where the values are."""
    return PackedNumbers(values.whole[chosen], values.units) if isinstance(values, PackedNumbers) else values[chosen]


def _fill(whole: AnyArray, values: Floats, units: float) -> bool:
    """Fill some rows; whether they have the bits of the values."""
    whole[:] = np.rint(values * units)
    whole[(values == 0) & np.signbit(values)] = np.iinfo(whole.dtype).min
    return _decimals(whole, units).tobytes() == values.tobytes()


def _decimals(whole: AnyArray, units: float) -> Floats:
    found = np.asarray(whole / units)
    if whole.dtype.kind == "i":
        found[whole == np.iinfo(whole.dtype).min] = -0.0
    return found
