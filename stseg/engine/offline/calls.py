"""A call whose result is needed later: in another process, while this one goes on, or here, at once."""

import signal
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Protocol, TypeVar

from stseg.engine.workers.worker_processes import CONTEXT, started_process
from stseg.errors import StsegError
from stseg.kernels.accelerate import compilation_noted

_Result = TypeVar("_Result")


class Caller(Protocol):
    """Begins a call, and yields what returns its result."""

    def __call__(
        self, function: Callable[..., _Result], *arguments: object
    ) -> AbstractContextManager[Callable[[], _Result]]: ...


@contextmanager
def called_here(function: Callable[..., _Result], *arguments: object) -> Iterator[Callable[[], _Result]]:
    """Call in this process, at once: what is needed only beside the result takes no memory yet."""
    result = function(*arguments)
    yield lambda: result


@dataclass(frozen=True)
class _Note:
    """A line about the work in another process."""

    text: str


@contextmanager
def called_beside(
    note: Callable[[str], None], function: Callable[..., _Result], *arguments: object
) -> Iterator[Callable[[], _Result]]:
    """Call in another process at once, or in this one if that dies; arguments and result are pickled.

    `note` is called with lines about the work, once the result is waited for.
    """
    receiver, other = CONTEXT.Pipe(duplex=False)
    process = started_process(_answer, other, function, arguments)
    other.close()

    def result() -> _Result:
        try:
            while isinstance(answer := receiver.recv(), _Note):
                note(answer.text)
        except EOFError:
            return function(*arguments)
        if isinstance(answer, StsegError):
            raise answer
        return answer  # type: ignore[no-any-return]  # as the other process returned it

    try:
        yield result
    finally:
        process.kill()
        process.join()
        receiver.close()


def _answer(pipe: Connection, function: Callable[..., object], arguments: tuple[object, ...]) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with suppress(BrokenPipeError):  # nobody waits any more
        try:
            with compilation_noted(lambda text: pipe.send(_Note(text))):
                pipe.send(function(*arguments))
        except StsegError as error:
            pipe.send(error)
