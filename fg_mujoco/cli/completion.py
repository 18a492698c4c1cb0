"""Tab completion in bash, zsh and fish, by argcomplete, the extra `completion`; docs/start.md says how to switch it on.

The shell calls `fg-mujoco` with the variable _ARGCOMPLETE set; without it nothing here is imported. Of the commands
only that of the line is.
"""

from __future__ import annotations

import argparse
import contextlib
import os
from collections.abc import Callable, Iterable, Sequence
from typing import Any


def complete(parser: argparse.ArgumentParser) -> None:
    """Answer the shell with what the word under the cursor may become, and exit, if it is the shell that asks."""
    if "_ARGCOMPLETE" not in os.environ:
        return
    with contextlib.suppress(ImportError):  # the shell completes nothing
        import argcomplete

        _offer_names(parser, os.environ.get("COMP_LINE", "").split()[1:2])
        argcomplete.autocomplete(parser)


def _offer_names(parser: Any, command: Sequence[str] | None = None) -> None:
    """Add the options of a command of the line (None: of all), and what completes names; the shell offers files."""
    parser.fill()
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, each in action.choices.items():
                if command is None or name in command:
                    _offer_names(each)
        elif getattr(action, "names", None) is not None:
            setattr(action, "completer", _completer(action.names))  # noqa: B010


def _completer(names: Callable[[], Iterable[str]]) -> Callable[..., list[str]]:
    """Return argcomplete's completer of names; of a list with commas it completes the last one."""

    def completer(prefix: str, **_: Any) -> list[str]:
        before, comma, _last = prefix.rpartition(",")
        return [f"{before}{comma}{name}" for name in names()]

    return completer
