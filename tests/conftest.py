"""Settings of all tests."""

from hypothesis import settings

# Examples take as long as they take on a machine that others use, too: only a whole test may be too slow.
settings.register_profile("timeless", deadline=None)
settings.load_profile("timeless")
