"""The folder that a command writes: `--out DIR`, `--out runs/`, which numbers itself, and `--force`.

A path that ends in a slash, and a folder with files that are neither a run's nor a study's, get a folder with the next
number: runs/001, runs/002. A folder that has a run is refused, one that has a study is gone on with, and `--force`
replaces either. No other folder is replaced, nor one with a file in it that no command here writes.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import secrets
import shutil
import sys
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from itertools import count
from pathlib import Path

from .. import from_addons
from ..course.course import Course
from ..course.files import is_file, is_folder, noting_files, read_text
from ..errors import FgMujocoError, RunFolderError, SettingsError
from .command import OUTPUT, Part, option

PAGE = "report.html"
"""Name of a run's page in its folder."""

RUN, STUDY = "run", "study"
"""Kinds of folders that commands write."""

_MARKS = ("manifest.json", "lab.json")  # of a study
_OF_A_RUN = re.compile(
    r"scene\.xml|states\.npz|telemetry(_car_\d+)?\.csv|trace\.png|controller(_car_\d+)?\.(py|json|onnx|zip)|failed_scan\.npz"
    r"|summary\.json|report\.html|debug\.html|recording\.mcap"
)
_OF_A_STUDY = re.compile(r"[\w.+-]+\.(json|jsonl|csv|npz|md|png|svg|html)|chunks|poses|cells")
_ASIDE = re.compile(r"\.fg_mujoco-[0-9a-f]{16}\.partial")  # what a killed process left (course.writing)
_MOST_BYTES = 16 * 2**20  # of a study's mark
_NOT_READ = (".html", ".htm", ".png", ".mp4", ".gif")  # of a folder: pages and pictures


def out_options(kind: str, text: str, *, required: bool = False) -> Part:
    """Return the part that adds `--out` and `--force` to a command, whose folder has a run or a study."""
    out = option("--out", f"{text}; DIR/ numbers itself: DIR/001", "DIR", title=OUTPUT, required=required)
    force = option("--force", f"replace the {kind} that DIR has", title=OUTPUT)

    def add(parser: argparse.ArgumentParser) -> None:
        parser.set_defaults(folder_kind=kind)
        out(parser), force(parser)

    return add


def write_page(folder: str | Path) -> None:
    """Write the page of a run into its folder; say so if its add-on cannot be imported."""
    try:
        write = from_addons.report_race
    except FgMujocoError as error:
        print(f"fg-mujoco: {PAGE} is left out; {error}", file=sys.stderr)
        return
    write(folder)


def written_rows(out: str | None) -> list[tuple[str, str]]:
    """Return the rows of a table that say where a run was written, and its page; none where it was not."""
    page = Path(out or "") / PAGE
    return [] if out is None else [("written to", out), *([("report", str(page))] if page.is_file() else [])]


@contextmanager
def chosen_folder(options: argparse.Namespace, kind: str | None) -> Iterator[None]:
    """Set `options.out` to the folder that is written. A run or study that is replaced is put aside, and then removed.

    If the command ends without a new one, the old one is put back.

    Args:
      options: of a command, whose `out` and `force` say where.
      kind: what its folder has; None: the command writes none.

    Raises:
      RunFolderError: the folder has a run already, or may not be replaced. The message names both ways on.
    """
    if kind is None or options.out is None:
        yield
        return
    given = str(options.out)
    folder, there = Path(given), _kind_of(given)
    parent = folder.parent if folder.parent != Path() else Path("runs")
    ways = f"or --out {parent}/, which numbers itself"
    if there == kind:
        ways = f"--force to replace it, {ways}"
    if there is None:
        if given.endswith(("/", os.sep)) or (is_folder(folder) and _has_files(folder)):
            with _numbered(folder) as options.out:
                goes_on = "; the same command goes on with it if that is given" if kind == STUDY else ""
                print(f"fg-mujoco: --out is {options.out}{goes_on}", file=sys.stderr)
                yield
            return
        yield
    elif options.force:
        with _replaced(Path(os.path.realpath(folder)), kind, there):
            yield
    elif there == kind == STUDY:
        try:
            yield
        except RunFolderError as error:  # it is one of other settings, or damaged
            hint = f", {ways}" if "accepted: " in str(error) and str(error).startswith(given) else ""
            raise RunFolderError(f"{error}{hint}") from error
    else:
        raise RunFolderError(f"{folder}: has a {there}; accepted: a new or empty folder, {ways}")


def require_new(*paths: str | Path, force: bool, reads: Iterable[object] = ()) -> None:
    """Refuse, before the work, to write files that exist, that cannot be written, or that the command reads.

    Args:
      paths: that it will write.
      force: `--force`, which replaces files that exist, but none that the command reads.
      reads: texts and paths of what it reads, and lists of them; what is no file is ignored.

    Raises:
      SettingsError: it exists, or is read.
      RunFolderError: it cannot be written.
    """
    from ..course.writing import require_writable, writing

    values = [each for value in reads for each in (value if isinstance(value, (list, tuple)) else [value])]
    texts = [str(each) for each in values if isinstance(each, (str, Path))]
    read = {*texts, *(text.partition("[")[0] for text in texts)}
    for path in map(Path, paths):
        if os.path.exists(path):
            if any(_is_read(path, text) for text in read):
                raise SettingsError(f"{path}: is read by this command; accepted: another file")
            if not force:
                raise SettingsError(f"{path}: exists; accepted: a new file, or --force to replace it")
        with writing(path):
            require_writable(path)


def _is_read(path: Path, text: str) -> bool:
    """Return whether a file is the one that a text names, or one in a folder that it names, but no page or picture."""
    try:
        folder = os.path.samefile(path.absolute().parent, text) and path.suffix.lower() not in _NOT_READ
        return folder or os.path.samefile(path, text)
    except (OSError, ValueError):
        return False


def given(options: argparse.Namespace, *but: str) -> list[object]:
    """Return the values of a command's options but some: what it reads is among them."""
    return [value for name, value in vars(options).items() if name not in but]


def course_files(course: Course | str) -> list[str]:
    """Return the files that a course is read from, none for one that is loaded.

    Raises:
      TrackError: it cannot be read.
    """
    from ..simulation.course_loading import load_track

    with noting_files() as read:
        if isinstance(course, str):
            load_track(course)
    return list(read)


@contextmanager
def new_files(folder: Path | None, *paths: Path, options: argparse.Namespace) -> Iterator[None]:
    """Make the folder of a command before its work, and refuse files that it cannot write there in the end.

    The folder is claimed, and removed again if it stays empty; None: the files are elsewhere.

    Raises:
      SettingsError: as `require_new`.
      RunFolderError: the folder cannot be made, or another process has claimed it.
    """
    from ..course.writing import claimed_folder, writing

    with ExitStack() as stack:
        if folder is not None:
            with writing(folder):
                stack.enter_context(claimed_folder(folder))
        require_new(*paths, force=options.force, reads=given(options, "out", "report"))
        yield


def _kind_of(folder: str) -> str | None:
    """Return whether a folder has a run or a study; None: neither."""
    from ..racing.run_folder import SUMMARY

    if any(is_file(Path(folder) / name) for name in _MARKS):
        return STUDY
    return RUN if is_file(Path(folder) / SUMMARY) else None


def _has_files(folder: Path) -> bool:
    """Return whether a folder has anything but what a killed process left, which the next write removes."""
    return not all(_ASIDE.fullmatch(path.name) for path in folder.iterdir())


@contextmanager
def _numbered(parent: Path) -> Iterator[str]:
    """Make the folder with the next number in another, and yield its path; one that stays empty is removed again."""
    from ..course.writing import writing

    with writing(parent, "a folder that can be"):
        parent.mkdir(parents=True, exist_ok=True)
        numbers = [int(path.name) for path in parent.iterdir() if re.fullmatch("[0-9]{3,9}", path.name)]
        for number in count(max(numbers, default=0) + 1):
            path = parent / f"{number:03}"
            with suppress(FileExistsError):  # another process was faster
                path.mkdir()
                break
    try:
        yield str(path)
    finally:
        with suppress(OSError):
            path.rmdir()


@contextmanager
def _replaced(folder: Path, kind: str, there: str) -> Iterator[None]:
    """Put a run or study aside; in the end remove it if there is a new one, else put it back."""
    _require_ours(folder, kind, there)
    aside = folder.with_name(f"{folder.name}.replaced-{secrets.token_hex(4)}")
    try:
        folder.rename(aside)
    except OSError as error:
        raise RunFolderError(f"{folder}: cannot be replaced: {error.strerror}; accepted: a new folder") from error
    try:
        yield
    finally:
        if _kind_of(str(folder)) is None:
            with suppress(OSError):
                folder.rmdir()  # empty, or not there
            aside.rename(folder)
        else:
            shutil.rmtree(aside, ignore_errors=True)


def _require_ours(folder: Path, kind: str, there: str) -> None:
    """Make sure that a folder has a run or study of this package, as the command writes it, and nothing else."""
    if there != kind:
        raise RunFolderError(f"{folder}: has a {there}; accepted with --force: a {kind}, which it replaces")
    if kind == RUN:
        from ..racing.run_folder import read_summary

        read_summary(folder)
    else:
        mark = next(folder / name for name in _MARKS if is_file(folder / name))
        try:
            ours = "schema" in json.loads(read_text(mark, _MOST_BYTES))
        except (OSError, ValueError, TypeError, RecursionError):
            ours = False
        if not ours:
            raise RunFolderError(f"{mark}: is not of a study; accepted with --force: a folder that a study wrote")
    known = _OF_A_RUN if kind == RUN else _OF_A_STUDY
    for path in sorted(folder.iterdir()):
        if path.is_symlink() or not (known.fullmatch(path.name) or _ASIDE.fullmatch(path.name)):
            raise RunFolderError(
                f"{folder}: has {path.name}, which is not of a {kind}; accepted with --force: a folder without it"
            )
