"""Commands as data: their options, and the function that runs each, whose docstring is the help.

    @command(option("--json", "print JSON"), setup_options("track"))
    def show(options: argparse.Namespace) -> int:
        ...

`main.COMMANDS` and the table of the add-ons name them. What a command takes is a list of parts; a part is a function
that adds an option, or several, to the command's parser. Those of a Setup are in `options`.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import MissingExtraError, SettingsError
from ..racing.planners import read_settings_text

Part = Callable[[argparse.ArgumentParser], object]
Run = Callable[[argparse.Namespace], int]

OUTPUT = "output"
"""Title in the help of the options of what a command writes."""

_COMMA = re.compile(r",(?![^\[]*\])")  # outside brackets


@dataclass(frozen=True)
class Command:
    """A command: what it does in a sentence, its parts, and the function that runs it and returns the exit code."""

    text: str
    parts: Sequence[Part]
    run: Run

    def fill(self, parser: argparse.ArgumentParser) -> None:
        """Add the options to the parser of the command."""
        parser.description = self.text
        parser.set_defaults(run=self.run, command=parser)
        for part in self.parts:
            part(parser)


@dataclass(frozen=True)
class Commands:
    """A command of several, such as `track new` and `track list`."""

    text: str
    commands: Mapping[str, Command]

    def fill(self, parser: argparse.ArgumentParser) -> None:
        """Add the commands, each with its options."""
        parser.description = self.text
        below = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
        for name, each in self.commands.items():
            each.fill(below.add_parser(name, help=each.text, allow_abbrev=False))


def command(*parts: Part) -> Callable[[Run], Command]:
    """Return a decorator that makes a command of the function that runs it; the help is the function's docstring."""

    def made(run: Run) -> Command:
        text = " ".join((run.__doc__ or "").split()).removesuffix(".")
        return Command(text[:1].lower() + text[1:], parts, run)

    return made


def option(
    name: str,
    text: str,
    metavar: str | None = None,
    reads: Callable[[str], Any] | None = None,
    default: Any = None,
    *,
    names: Callable[[], Iterable[str]] | None = None,
    title: str | None = None,
    **more: Any,
) -> Part:
    """Return the part that adds an option or, where the name has no hyphens, a positional argument.

    Args:
      name: of the option.
      text: help; `{names}` stands for the names that it takes.
      metavar: that stands for its value; None: it is a flag.
      reads: makes the value of a text.
      default: of the value.
      names: returns the names that it takes, for the shell.
      title: of the group in the help.
      more: as `add_argument` takes them.
    """
    more = {"default": default} | more
    if metavar is not None:
        more |= {"metavar": metavar} if reads is None else {"metavar": metavar, "type": reads}
    elif "action" not in more:
        more |= {"action": "store_true", "default": False}

    def add(parser: argparse.ArgumentParser) -> None:
        action = (parser if title is None else group(parser, title)).add_argument(name, help=text, **more)
        setattr(action, "names", names)  # noqa: B010

    return add


def group(parser: argparse.ArgumentParser, title: str) -> argparse._ArgumentGroup:
    """Return the group of a command's options that has a title in its help; a new one, if there is none."""
    there = (each for each in parser._action_groups if each.title == title)
    return next(there, None) or parser.add_argument_group(title)


def names_in(text: str) -> list[str]:
    """Read names with commas between them; a comma in brackets is part of a name."""
    names = [name.strip() for name in _COMMA.split(text)]
    if not all(names):
        raise argparse.ArgumentTypeError(f"{text!r}; accepted: names, a comma between two")
    return names


def whole(text: str) -> int:
    """Read a whole number."""
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}; accepted: a whole number") from None


def number(text: str) -> float:
    """Read a number."""
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}; accepted: a number") from None


def numbers_in(text: str) -> tuple[float, ...]:
    """Read `4,6.5`."""
    return tuple(number(part.strip()) for part in text.split(","))


def pairs(text: str) -> dict[str, Any]:
    """Read `x=1,y=2`."""
    try:
        return read_settings_text(text)
    except SettingsError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def named_values(texts: Iterable[str], option: str, what: str) -> dict[str, str]:
    """Return the values by name of texts such as `mu=0.6:1.2`.

    Args:
      texts: that an option was given, each once.
      option: its name, for messages.
      what: is accepted, as "NAME=VALUE".

    Raises:
      SettingsError: a text without a name, or a name given twice.
    """
    found: dict[str, str] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or name in found:
            raise SettingsError(f"{option} {text!r}; accepted: {f'{name} once' if equals else what}")
        found[name] = value
    return found


JSON = option("--json", "print one JSON object and nothing else")
WORKERS = option("--workers", "processes; default: as many as there are cores", "N", whole)
FORCE = option("--force", "replace files that exist")
CONFIG = option(
    "--config", "settings from a TOML file, or from a run folder to race it again; options win", "FILE"
)


ASKED = option(
    "--controller", "planner that is asked again, in the settings of the run; default: none, only commands", "NAME"
)


def require_ending(path: Path | None, *endings: str, what: str = "a file", when: str = "") -> None:
    """Refuse the path of a file whose name has none of some endings, in lower case; None is accepted.

    Raises:
      SettingsError: it has another; the message says what the file is, and when such a file is written.
    """
    if path is not None and path.suffix.lower() not in endings:
        raise SettingsError(f"{path}: is no name for {what}; accepted{when}: one that ends in {endings[0]}")


def can_draw(what: str, *, several: bool = True) -> bool:
    """Return whether there is matplotlib; if not, say on stderr that `what` is left out, and how to have it."""
    from ..pictures.pages.figure_kit import require_matplotlib

    try:
        require_matplotlib()
    except MissingExtraError as error:
        print(f"fg-mujoco: {what} {'are' if several else 'is'} left out; {error}", file=sys.stderr)
        return False
    return True
