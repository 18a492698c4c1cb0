"""The command `fg-mujoco`: its parser, its exit codes, and the registry of its commands.

Exit codes: 0 all went well, 1 a race that was not driven to its end or a replay that differs, 2 input that cannot be
used, or a file that cannot be written (one line on stderr, nothing written).
"""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
import threading
import warnings
from collections.abc import Iterator, Sequence
from functools import cache
from typing import Any, NoReturn

from ..course.formats import track_names
from ..errors import FgMujocoError, FinalWarning, Note, SettingsError, accepted_names, gone, nearest
from ..interrupts import ended_in_order
from ..racing.planners import controller_names, scheme_of
from ..registry import Registry, added
from .command import Command, Commands
from .options import in_one_line, in_options
from .out import chosen_folder
from .progress import UnfinishedError

_NOT_DONE, _BAD_INPUT = 1, 2
_INTERRUPTED, _TERMINATED = 130, 143  # what shells call a command that Ctrl-C, and one that SIGTERM has ended


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code."""
    options = None
    terminated = threading.Event()
    try:
        with _warnings_in_a_line(), ended_in_order(terminated):
            given = sys.argv[1:] if arguments is None else arguments
            parser = _parser(texts=given[:1] in (["-h"], ["--help"]))
            if "_ARGCOMPLETE" in os.environ:
                from .completion import complete

                complete(parser)
            options = parser.parse_args(arguments)
            if getattr(options, "config", None) is not None:
                from .config import parse

                options = parse(parser, arguments)
            with chosen_folder(options, getattr(options, "folder_kind", None)):
                code: int = options.run(options)
        sys.stdout.flush()
    except FgMujocoError as error:
        said = str(error) if options is None else in_options(str(error), options.command)
        print("fg-mujoco:", in_one_line(said), file=sys.stderr)
        return _BAD_INPUT
    except UnfinishedError as error:
        print("fg-mujoco:", in_one_line(str(error)), file=sys.stderr)
        return _NOT_DONE
    except KeyboardInterrupt:
        return _TERMINATED if terminated.is_set() else _INTERRUPTED
    except BrokenPipeError:  # the reader of our output has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return _NOT_DONE
    return code


@contextlib.contextmanager
def _warnings_in_a_line() -> Iterator[None]:
    """Print each warning and note that is meant for users once, a line each on stderr: a FinalWarning at the end.

    Notes and NumPy's warnings come at the end, too, and not at all where a command is refused: a refusal is one line.
    """
    shown: dict[str, type[Warning]] = {}
    of_numpy: list[tuple[Any, ...]] = []

    def show(message: Warning | str, category: type[Warning], *place: Any, **more: Any) -> None:
        if category is SyntaxWarning:  # of a planner's file, as Python's compiler finds it
            file, line = place[:2]
            say(f"{file}, line {line}: {message}")
        elif category is RuntimeWarning:
            of_numpy.append((message, category, *place))
        elif category not in (UserWarning, FinalWarning, Note):
            usual(message, category, *place, **more)
        elif str(message) not in shown:
            shown[str(message)] = category
            if category is UserWarning:
                say(str(message))

    def say(message: str) -> None:
        print("fg-mujoco: warning:", *message.split(), file=sys.stderr)

    with warnings.catch_warnings():
        warnings.simplefilter("always", Note)
        usual, warnings.showwarning = warnings.showwarning, show
        try:
            yield
            for message, category in shown.items():
                if category is Note:
                    print("fg-mujoco:", in_one_line(message), file=sys.stderr)
        except FgMujocoError:
            of_numpy.clear()
            raise
        finally:
            for each in of_numpy:
                usual(*each)
            for message, category in shown.items():
                if category is FinalWarning:
                    say(message)


class _Help(argparse.HelpFormatter):
    """Writes the names that an option takes in the place of `{names}` in its help: to list them takes a while."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        text, names = action.help, getattr(action, "names", None)
        return text if not text or names is None else text.replace("{names}", ", ".join(names()))


class _Parser(argparse.ArgumentParser):
    """Complains in one line, and says which option or command was probably meant. A command is made where it is used.

    Attributes:
      place: name of the command whose options are to be added yet; None: they are there.
    """

    place: str | None = None

    def __init__(self, *arguments: Any, **named: Any) -> None:
        super().__init__(*arguments, **{"formatter_class": _Help} | named)

    def fill(self) -> None:
        """Add the options of a command, which takes a while to import."""
        if self.place is not None:
            found, self.place = COMMANDS.find(self.place), None
            found.fill(self)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse; what is not known is refused by the command that it was given to, whose options are looked up."""
        self.fill()
        given = list(sys.argv[1:] if args is None else args)
        if self._subparsers is None:
            for name in (each.partition("=")[0] for each in given[: given.index("--") if "--" in given else None]):
                if name.startswith("--") and name not in self._option_string_actions:
                    self.error(self._no_option(name))  # before what lacks
        elif given and given[0].startswith("--") and given[0] not in self._option_string_actions:
            self.error(f"{given[0]!r} stands before the command; accepted: {self.prog} COMMAND {given[0]}")
        options, left = super().parse_known_args(given, namespace)
        left = [each for each in left if each != "--"] or left
        if left:
            self.error(self._no_option(left[0]) if left[0].startswith("-") else self._no_argument(left[0]))
        return options, left

    def _no_option(self, given: str) -> str:
        """Return what is said of an option that there is not."""
        went = gone(f"{self.prog} {given}")
        if went is not None:
            return went
        known = [option for option in self._option_string_actions if option.startswith("--")]
        from .words import command_for

        command, meant = command_for(given), nearest(given, known, cutoff=1.0)
        if not given.startswith("--"):
            meant = "--out" if given == "-o" and "--out" in known else None
        elif meant is None and command is None:
            meant = nearest(given, known)
        hint = command if meant is None else f"did you mean {meant!r}?"
        return f"{given!r} is no option here" + ("" if hint is None else f"; {hint}")

    def _no_argument(self, given: str) -> str:
        """Return what is said of a word for which there is no place: it may be the value of an option."""
        course = given.endswith((".csv", ".json", ".npy", ".yaml", ".yml")) or given.startswith(("random:", "scene:"))
        source = given.partition("[")[0]
        means = {
            "--track": course or given in track_names(),
            "--controller": ".py" in given or bool(scheme_of(source)) or source in controller_names(),
        }
        option = next((name for name, fits in means.items() if fits and name in self._option_string_actions), None)
        return f"{given!r} is no argument here" + ("" if option is None else f"; did you mean '{option} {given}'?")

    def _get_values(self, action: argparse.Action, arg_strings: list[str]) -> Any:
        if action.option_strings and action.nargs is None and arg_strings == ["--"]:  # argparse would lose it
            arg_strings = ["--", "--"]
        return super()._get_values(action, arg_strings)

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            name = action.metavar if isinstance(action.metavar, str) else "COMMAND"
            went = None if action.option_strings else gone(f"{self.prog} {value}")
            if went is not None:
                raise argparse.ArgumentError(None, went)
            from .words import command_for

            rather = command_for(value) if self.prog == "fg-mujoco" else None
            listed = accepted_names(value, action.choices)
            end = listed if rather is None else f"{listed.partition('; did you mean')[0]}; {rather}"
            if action.option_strings:
                raise argparse.ArgumentError(None, f"{name} is {value!r}; {end}")
            listed = end.replace("accepted:", f"{name.lower()}s:", 1)
            raise argparse.ArgumentError(None, f"there is no {name.lower()} {value!r}; {listed}")

    def error(self, message: str) -> NoReturn:
        if message.endswith("required: COMMAND") and self._subparsers is not None:
            message = f"no command is given; accepted: {', '.join(self._subparsers._group_actions[0].choices or ())}"
        self.exit(_BAD_INPUT, f"{self.prog}: {in_one_line(message)}; see {self.prog} --help\n")


COMMANDS: Registry[Command | Commands] = Registry(
    "command",
    SettingsError,
    own={
        name: f"fg_mujoco.cli.{place}"
        for name, place in {
            "race": "race:race_command", "replay": "replay:replay_command", "drive": "drive:drive_command",
            "track": "track:TRACK", "controllers": "lists:controllers_command", "vehicles": "lists:vehicles_command",
            "rollout": "rollout:rollout_command", "render": "render:render_command",
            "friction": "friction:friction_command",
        }.items()
    } | added("COMMANDS"),
)  # fmt: skip
"""Commands in the order of the help: nine of the core, then those of add-ons."""


class _Version(argparse.Action):
    """Prints the version, which takes a while to look up."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from importlib.metadata import version

        print(f"fg-mujoco {version('fg-mujoco')}")
        parser.exit()


@cache
def _parser(texts: bool = False) -> _Parser:
    """Return the parser of all commands; that of each gets its options where it is used."""
    parser = _Parser(
        prog="fg-mujoco", description="A MuJoCo 3D testbed for F1TENTH cars.", allow_abbrev=False,
        epilog=_addons_text(), formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    parser.add_argument("--version", action=_Version, nargs=0, help="show program's version number and exit")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    for name in COMMANDS:
        own: dict[str, Any] = {"help": COMMANDS.find(name).text} if texts and name not in added("COMMANDS") else {}
        commands.add_parser(name, allow_abbrev=False, **own).place = name
    return parser


def _addons_text() -> str:
    """Return the lines of the help that name the commands of each add-on."""
    of_addons: dict[str, list[str]] = {}
    for name, place in added("COMMANDS").items():
        of_addons.setdefault(place.split(".")[2], []).append(name)
    width = max(map(len, of_addons), default=0)
    lines = [f"  {addon:<{width}}  {', '.join(names)}" for addon, names in of_addons.items()]
    return "\n".join(["commands of add-ons:", *lines, "", "fg-mujoco COMMAND --help explains a command."])
