"""Numbers with what they count, for lines of output."""


def counted(number: int, noun: str) -> str:
    """A number and a noun whose plural ends in -s: 1 frame, 2 frames."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
