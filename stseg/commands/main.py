"""The command `stseg`: one sub-command a file, imported once it is asked for."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Sequence
from difflib import get_close_matches
from types import FrameType
from typing import Any

from cyclopts import App, CycloptsError

from stseg import __version__
from stseg.errors import ConfigError, StsegError

COMMANDS = {
    "demo": ("stseg.commands.demo:demo", "Render a small scene, track it, score it, write the report."),
    "run": ("stseg.commands.run:run", "Track the people of a recording."),
    "inspect": ("stseg.commands.inspect:inspect", "Say what is in a run file."),
    "export": ("stseg.commands.export:export", "Write the tracks of a run file in another format."),
    "evaluate": ("stseg.commands.evaluate:evaluate", "Score tracks on the ground against the truth."),
    "report": ("stseg.commands.report:report", "Write pictures of a run file as one HTML page."),
    "plan": ("stseg.commands.plan:plan", "Say how long a run will take and how large its file will be."),
    "labels": ("stseg.commands.labels:labels", "Write for every pixel whom it shows."),
    "calibrate": ("stseg.commands.calibrate:app", "Make a rig file."),
    "simulate": ("stseg.commands.simulate:simulate", "Make a scene with truth."),
}
"""Where each command is, and the line that `stseg --help` says of it."""

_FLAGS = ("--help", "-h", "--version")
_USER_ERROR = 2
_INTERRUPTED, _TERMINATED = 130, 143


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line and return its exit status; what the user can mend is one line on standard error."""
    tokens = list(sys.argv[1:] if arguments is None else arguments)
    termination = Termination()
    try:
        _require_command(tokens)
        _app(tokens)(tokens, exit_on_error=False, print_error=False, result_action="return_value")
        sys.stdout.flush()
    except (StsegError, CycloptsError) as error:
        print(f"stseg: error: {' '.join(str(error).split())}", file=sys.stderr)
        return _USER_ERROR
    except KeyboardInterrupt:
        print(f"stseg: {'terminated' if termination.asked else 'interrupted'}", file=sys.stderr)
        return _TERMINATED if termination.asked else _INTERRUPTED
    except BrokenPipeError:  # the reader of our output, such as head, has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    finally:
        termination.forget()
    return 0


class Termination:
    """SIGTERM does what an interrupt does: what is being written is written or withdrawn, and the command ends."""

    def __init__(self) -> None:
        self.asked = False
        self._before: Any = signal.SIG_DFL
        if threading.current_thread() is threading.main_thread():
            self._before = signal.signal(signal.SIGTERM, self._ask)

    def forget(self) -> None:
        """Let SIGTERM do what it did before."""
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGTERM, self._before)

    def _ask(self, _number: int, _frame: FrameType | None) -> None:
        self.asked = True
        raise KeyboardInterrupt


def _app(tokens: Sequence[str]) -> App:
    """The command that is asked for speaks for itself; the others have a line in the list and are not imported."""
    app = App(
        name="stseg",
        help="Tracks of people on the ground from several fixed, overlapping cameras.",
        version=__version__,
        suppress_keyboard_interrupt=False,
    )
    for name, (path, summary) in COMMANDS.items():
        app.command(path, name=name, help=None if name in tokens[:1] else summary)
    return app


def _require_command(tokens: Sequence[str]) -> None:
    """Refuse what is no command here: to suggest one, cyclopts would import them all."""
    if tokens and tokens[0] not in (*COMMANDS, *_FLAGS):
        close = get_close_matches(tokens[0], COMMANDS, 1)
        hint = f"; did you mean {close[0]}?" if close else ""
        raise ConfigError("command line", "", repr(tokens[0]), f"one of {', '.join(COMMANDS)}{hint}")
