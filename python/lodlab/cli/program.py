# SPDX-License-Identifier: MIT
"""The command line: a thin layer over the Python face. Exit status: 0 done; 1 something failed, a check did not
hold, or a run broke a promise (its results are there); 2 the user's mistake; 130 stopped by Ctrl-C. `LODLAB_DEBUG=1`
shows the traceback of any error. Commands stand in files by what they do; every one declares its arguments, each on
its line, those that come together in groups (`arguments.unfolded`).
"""

from __future__ import annotations

import errno
import os
import sys
import traceback
import warnings
from collections.abc import Sequence
from typing import Annotated, Any

import typer

import lodlab

from ..errors import BrokenPromise, GLError, InvalidInput, StoreError, Unsupported
from . import build, fly, inventory, render, verdicts

app = typer.Typer(
    name="lodlab",
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    epilog="Example: lodlab compare jacksboro --out runs/jacksboro",
)


def _version(asked: bool) -> None:
    if asked:
        typer.echo(f"lodlab {lodlab.__version__}")
        raise typer.Exit


@app.callback()
def program(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Say the version and exit.")
    ] = False,
) -> None:
    """A laboratory for level of detail: build hierarchies of terrains and meshes, fly them under budgets, measure."""


for group in (inventory, build, fly, render, verdicts):  # as --help lists them
    app.registered_commands += group.commands.registered_commands

STOPPED = 130
_MISTAKES = (InvalidInput, Unsupported)
_FILE_MISTAKES = (FileNotFoundError, PermissionError, IsADirectoryError, NotADirectoryError, FileExistsError)
_NAME_MISTAKES = (errno.ENAMETOOLONG, errno.ELOOP)


#: Messages name Python's arguments; here each is said as this program has it.
SPOKEN = {
    'mode="force"': "--force",
    'mode="resume"': "--resume",
    "force=True": "--force",
    "source=SOURCE": "--source SOURCE",
    "accuracy_frames=0": "--accuracy-frames 0",
    "max={'measured_px_max': 1}": "--max measured_px_max=1",
    "accuracy_frames is": "--accuracy-frames is",
    "pixel_error, triangles, nodes": "--pixel-error, --triangles, --nodes",
}


def spoken(message: Any) -> str:
    """A message as one line that names this program's arguments."""
    line = " ".join(str(message).split())
    for python, ours in SPOKEN.items():
        line = line.replace(python, ours)
    return line


def status_of(error: BaseException) -> tuple[int, str]:
    """(exit status, the one line that says what is wrong)."""
    if isinstance(error, KeyboardInterrupt) or isinstance(error.__cause__, KeyboardInterrupt):
        return STOPPED, "stopped; what was finished is kept"
    if hasattr(error, "format_message") and hasattr(error, "exit_code"):  # typer's own, whatever click it uses
        return int(error.exit_code), error.format_message()
    if isinstance(error, _MISTAKES):
        return 2, str(error)
    if isinstance(error, (StoreError, GLError)):
        return 1, str(error)
    if isinstance(error, OSError):
        mistake = isinstance(error, _FILE_MISTAKES) or error.errno in _NAME_MISTAKES
        text = f"{error.strerror or error}: {error.filename}" if error.filename else str(error)
        return 2 if mistake else 1, text
    if isinstance(error, MemoryError):
        return 1, f"out of memory: {error}" if str(error) else "out of memory"
    return 1, f"{type(error).__name__}: {error} (LODLAB_DEBUG=1 shows where)"


def run(arguments: Sequence[str] | None = None) -> int:
    """Runs the command line and returns its exit status: 1 where all went well but a run broke a promise."""
    broken = False

    def warn(message: Warning | str, *_: Any, **__: Any) -> None:
        """A warning as one line, without the code that it came from."""
        nonlocal broken
        promise = isinstance(message, BrokenPromise)
        broken = broken or promise
        print(("error: " if promise else "warning: ") + spoken(message), file=sys.stderr)

    with warnings.catch_warnings():
        warnings.showwarning = warn
        warnings.simplefilter("always", BrokenPromise)
        return _run(arguments) or int(broken)


def _run(arguments: Sequence[str] | None) -> int:
    try:
        words = list(sys.argv[1:] if arguments is None else arguments) or ["--help"]
        status = int(app(args=words, prog_name="lodlab", standalone_mode=False) or 0)
        if status == STOPPED:  # typer turns Ctrl-C into this status, and says nothing
            raise KeyboardInterrupt
        return status
    except BrokenPipeError:  # `lodlab methods | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except (Exception, KeyboardInterrupt) as error:
        status, text = status_of(error)
        if os.environ.get("LODLAB_DEBUG"):
            traceback.print_exc()
        if text:
            print("error: " + spoken(text), file=sys.stderr)
        return status


def main() -> None:
    """The entry point of the program `lodlab`."""
    sys.exit(run())
