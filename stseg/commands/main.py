"""The command `stseg`: one sub-command a file, imported once it is asked for."""

import atexit
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from io import TextIOWrapper
from itertools import pairwise
from typing import Literal, NoReturn

from cyclopts import App, CycloptsError, MissingArgumentError

from stseg.commands.terminal.standard_error import patience, without_library_messages
from stseg.commands.terminal.termination import INTERRUPTED, TERMINATED, Termination
from stseg.errors import ConfigError, StsegError, one_of, printable
from stseg.import_path import leave_out_current_folder
from stseg.io.machine import address_space, collect_rarely
from stseg.version import __version__

COMMANDS = {
    "demo": ("stseg.commands.demo:demo", "Render a small scene, track it, score it, write the report."),
    "detect": ("stseg.commands.detect:detect", "Find people in videos: boxes, and a rig file with them."),
    "run": ("stseg.commands.run:run", "Track the people of a recording."),
    "inspect": ("stseg.commands.inspect:inspect", "Summarise a run file, or the sources of a rig file."),
    "export": ("stseg.commands.export:export", "Write the tracks of a run file in another format."),
    "evaluate": ("stseg.commands.evaluate:evaluate", "Score tracks on the ground against the truth."),
    "measure": ("stseg.commands.measure:measure", "Measure people in zones, at lines, and over the ground."),
    "report": ("stseg.commands.report:report", "Write a run file as one HTML page, as pictures or as a film."),
    "review": ("stseg.commands.review:review", "Ask about the identities of which a run is least sure."),
    "correct": ("stseg.commands.correct:correct", "Correct the identities of a run."),
    "plan": ("stseg.commands.plan:plan", "Estimate the time of a run and the size of its file."),
    "config": ("stseg.commands.config:config", "Print the configuration with the meaning of every key."),
    "labels": ("stseg.commands.labels:labels", "Write per-pixel track-id images."),
    "calibrate": ("stseg.commands.calibrate.app:app", "Make a rig file, or check one."),
    "completion": ("stseg.commands.main:completion", "Print the completion script of a shell."),
    "simulate": ("stseg.commands.simulate:simulate", "Render a scene with ground truth."),
}
"""Location of each command, and its line in `stseg --help`."""

_FILES = ("-o", "--output", "--video")
"""Options that name a file to write, but for these commands."""
_WRITERS_OF_FOLDERS = ("detect", "inspect", "labels", "measure")
_FLAGS = ("--help", "-h", "--version")
_GOING_ON = "; the same command goes on after the last finished segment, and begins anew where there is none"
_USER_ERROR = 2
_ADDRESS_SPACE = 2 * 2**30
"""Least address space in which the libraries of all commands work, bytes: with less, they crash as they are loaded."""


def command() -> NoReturn:
    """The program `stseg`; after a signal it ends without waiting for its threads.

    It never takes down its modules one by one, which takes a third of a second after a run.
    """
    status: int | None = None

    def leave() -> None:
        if status is not None:
            for stream in (sys.stdout, sys.stderr):
                with suppress(OSError, ValueError):
                    stream.flush()
            os._exit(status)

    leave_out_current_folder()
    collect_rarely()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # matrices are small; its threads wait for work by spinning
    os.environ["NUMBA_NUM_THREADS"] = "1"  # no kernel is parallel, and numba fails at numbers that are none
    atexit.register(leave)  # the first to be registered is the last to be called
    status = main()
    if status in (INTERRUPTED, TERMINATED):
        with suppress(OSError):
            sys.stdout.flush()
        os._exit(status)
    sys.exit(status)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line and return its exit status; a user's error is one line on standard error."""
    tokens = list(sys.argv[1:] if arguments is None else arguments)
    _require_streams()
    with without_library_messages(), patience():
        return _run(tokens)


def _run(tokens: list[str]) -> int:
    """Run a command line and return its exit status."""
    if address_space() < _ADDRESS_SPACE:
        found, least = (f"{size // 2**20} MiB" for size in (address_space(), _ADDRESS_SPACE))
        return _fail(f"limit of address space (ulimit -v): found {found}, expected {least} or more")
    termination = Termination(_GOING_ON if tokens[:1] == ["run"] else "")
    try:
        _require_command(tokens)
        _require_file_names(tokens)
        _app(tokens)(tokens, exit_on_error=False, print_error=False, result_action="return_value")
        sys.stdout.flush()
    except MissingArgumentError as error:
        return _fail(_missing(error, tokens))
    except StsegError as error:
        return _fail(str(error))
    except CycloptsError as error:
        return _fail(f"command line: {error}")
    except MemoryError:
        return _fail("this needs more memory than there is")
    except KeyboardInterrupt:
        print(termination.line, file=sys.stderr)
        return termination.status
    except BrokenPipeError:  # the reader of our output, such as head, has seen enough
        _drop_output()
    except OSError as error:
        _drop_output()  # or Python would try once more to write it
        return _fail(f"{error.filename or 'standard output'}: {error.strerror or error}")
    except Exception:
        if not termination.end_requested:
            raise
        print(termination.line, file=sys.stderr)  # the compiler has dropped the interrupt, and failed of it
        return termination.status
    finally:
        termination.forget()
    return 0


def _missing(error: MissingArgumentError, tokens: Sequence[str]) -> str:
    """The message for an option without a value, and for one that was left out."""
    names = () if error.argument is None else error.argument.names
    if not names:
        return str(error)
    command = " ".join(error.command_chain or ())
    if given := [token for token in tokens if token.partition("=")[0] in names]:
        return f"command line: {given[0]} needs a value; see stseg {command} --help"
    unknown = [token for token in error.unused_tokens or () if token.startswith("--")]
    misspelt = f"{unknown[0]} is no option, and " if unknown else ""
    return f"command line: {misspelt}{names[0]} is missing; see stseg {command} --help"


def _fail(message: str) -> int:
    """The error line of a command, and its exit status."""
    with suppress(OSError):
        print(f"stseg: error: {printable(' '.join(message.split()))}", file=sys.stderr)
    return _USER_ERROR


def _require_streams() -> None:
    """Make standard output and error take any text, also where they are closed or of another encoding."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w"))  # noqa: SIM115, PTH123  # for the life of the process
        elif isinstance(stream := getattr(sys, name), TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _drop_output() -> None:
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _app(tokens: Sequence[str]) -> App:
    """The application with the requested command imported; the others are a line in the list."""
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
    """Refuse an unknown command here: to suggest one, cyclopts would import them all."""
    if tokens and tokens[0] not in (*COMMANDS, *_FLAGS):
        raise ConfigError("command line", "", repr(tokens[0]), one_of(tokens[0], COMMANDS))


def _require_file_names(tokens: Sequence[str]) -> None:
    """Refuse the name of a folder for an output that is a file: paths drop the slash at its end."""
    words = [word for token in tokens for word in token.split("=", 1)]
    for option, value in pairwise(words):
        if option in _FILES and value.endswith(os.sep) and tokens[0] not in _WRITERS_OF_FOLDERS:
            raise ConfigError("command line", option, f"the name of a folder, {value!r}", "the name of a file")


def completion(shell: Literal["bash", "zsh", "fish"], /) -> None:
    """Print the completion script of a shell.

    Example: stseg completion bash > ~/.local/share/bash-completion/completions/stseg

    Example: stseg completion zsh > "${fpath[1]}/_stseg"

    Example: stseg completion fish > ~/.config/fish/completions/stseg.fish

    Parameters
    ----------
    shell
        bash, zsh or fish.
    """
    print(_app([]).generate_completion(shell=shell))
