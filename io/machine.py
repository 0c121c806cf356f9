"""The machine and this process: cores, free memory, address space, and garbage collection."""

import ctypes
import gc
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

try:
    import resource
except ImportError:  # Windows has no such limits
    resource = None  # type: ignore[assignment]

_ENDLESS = 1 << 62
_GROWTH = 1 << 30
"""Bytes: texts have at most 2^24, and threads beside want some."""
_COLLECTION = 100_000, 20, 100
"""Objects made and not freed at which the youngest are visited, and how many such visits lead to one of the older."""


def address_space() -> int:
    """Bytes of address space that a process of this user may have."""
    if resource is None:
        return _ENDLESS
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    return _ENDLESS if limit == resource.RLIM_INFINITY else limit


@contextmanager
def bounded_growth() -> Iterator[None]:
    """Within, the process cannot take more than a gigabyte of memory beyond what it has; Linux alone knows that.

    For libraries that ask for as much as a file says; threads beside share the bound.
    """
    bound = _held() + _GROWTH
    if bound >= min(address_space(), _ENDLESS):
        yield
        return
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (bound, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def _held() -> int:
    """Bytes of address space of this process; without end where the system does not say."""
    try:
        return int(Path("/proc/self/statm").read_text("ascii").split()[0]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError):
        return _ENDLESS


def return_freed_memory() -> None:
    """Give the system what was freed: the C library of Linux keeps it where a small block in use lies after it."""
    with suppress(AttributeError, OSError, TypeError):  # another library
        ctypes.CDLL(None).malloc_trim(0)


def collect_rarely() -> None:
    """Visit the living objects of this process rarely in search of cycles.

    Reference counts free all that a frame makes; the collector finds nothing in hours, and visits imports, tables and
    tracks for it: 3 % of a run's time with Python's thresholds.
    """
    gc.set_threshold(*_COLLECTION)


def free_cores() -> int:
    """Number of processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def free_memory() -> int:
    """Bytes that this process and its children may still use; by the kernel, and by the limits of a container."""
    return min(_available(), _left_in_group())


def _available() -> int:
    try:
        lines = Path("/proc/meminfo").read_text("ascii").splitlines()
        return next(1024 * int(line.split()[1]) for line in lines if line.startswith("MemAvailable:"))
    except (OSError, ValueError, StopIteration):  # no Linux
        return _ENDLESS


def _left_in_group() -> int:
    """Bytes that a control group leaves, of version 2 or 1: containers have one. Files in memory do not count."""
    for folder, limit, used in (("", "memory.max", "anon"), ("memory/", "memory.limit_in_bytes", "total_rss")):
        group = Path("/sys/fs/cgroup") / folder
        try:
            most = int((group / limit).read_text("ascii"))
            counts = dict(line.split() for line in (group / "memory.stat").read_text("ascii").splitlines())
            return max(0, most - int(counts[used]))
        except (OSError, ValueError, KeyError):  # no such group, or no limit
            continue
    return _ENDLESS
