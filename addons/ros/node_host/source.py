"""Reads a node's source before it is executed: which imports nothing uses, and which files it names that lie elsewhere.

On the machine that a node was written on all its imports are installed and its files lie where it says. Here an import
that fails does no harm where nothing uses what it binds. A file of data that is not where the node says is looked for
in the node's folder and in its package: `/home/me/ws/src/lab5/racelines/levine.csv` is `racelines/levine.csv` there. A
path that is written out is looked up before the file is executed, one that it puts together when it is read.
"""

from __future__ import annotations

import ast
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import CodeType
from typing import TypeVar

from fg_mujoco.course.files import is_file

from .workspace import module_folders

_DATA = {
    ".csv", ".txt", ".yaml", ".yml", ".json", ".npy", ".npz", ".pkl", ".pickle", ".pt", ".pth", ".onnx", ".zip", ".png",
    ".pgm", ".h5", ".mat", ".tum",
}  # fmt: skip
_PACKAGE = ("package.xml", "setup.py")
_JOINING = ("join", "joinpath")
_READING = ("open", "loadtxt", "genfromtxt", "read_csv", "load")
_FILE = ("file", "fname", "filepath_or_buffer")  # what these call their first argument
FINDER = "__fg_mujoco_found__"
"""Name, among the builtins, of the host's function that each path that a node reads is passed through."""
_LONGEST_PATH = 1000  # characters
_LEVELS = 4  # folders above the node's in which files are looked for

_TRIES = 20
T = TypeVar("T")

Unused = dict[int, set[str]]
"""Line of an import statement -> the names of it, as imported, that nothing in the file uses."""


@dataclass(frozen=True, kw_only=True)
class Source:
    """A file of a node, ready to be executed."""

    code: CodeType
    unused: Unused
    notes: tuple[str, ...]  # of files that lie elsewhere
    data: frozenset[str]  # paths of files of data that are written out in it


_ONE_AT_A_TIME = threading.Lock()  # Python 3.11 counts the depth of a tree for all threads together


def read_source(path: Path, text: bytes, node: Path) -> Source:
    """Return the code of a file that belongs to a node; SyntaxError, ValueError: it is no Python."""
    notes: list[str] = []
    with _ONE_AT_A_TIME:
        tree = parse(text, path)
        unused = unused_imports(tree)
        relocate_files(tree, node, lambda said, line: notes.append(f"{said} ({path}, line {line})"))
        data = frozenset(_written_out(tree))
        find_what_is_read(tree)
        code = _despite_depth(lambda: compile(tree, str(path), "exec"))
    return Source(code=code, unused=unused, notes=tuple(notes), data=data)


def parse(text: bytes, path: Path) -> ast.Module:
    """Return the tree of a file; SyntaxError, ValueError: it is no Python, or is nested too deeply."""
    try:
        return _despite_depth(lambda: ast.parse(text, str(path)))
    except (MemoryError, RecursionError) as error:
        raise ValueError("is nested too deeply") from error


def _despite_depth(work: Callable[[], T]) -> T:
    """Call `work()`; retry if it raises SystemError, because another thread corrupted the recursion counter."""
    for _ in range(_TRIES):
        with suppress(SystemError):
            return work()
    return work()


def unused_imports(tree: ast.Module) -> Unused:
    """Return the names that a file imports and does not use, without imports in a `try` statement."""
    used = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    used |= {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str)}
    found: Unused = {}
    for statement in _imports(tree):
        names = {
            each.name
            for each in statement.names
            if each.name != "*" and (each.asname or each.name.partition(".")[0]) not in used
        }
        if names:
            found[statement.lineno] = names
    return found


def own_files(node: Path, text: bytes) -> list[Path]:
    """Return the files of the user's own that a node's file imports, and those import, sorted; without its own.

    They are where the node's import statements find them, see `own_folders`, and in the other packages of its
    workspace. A file that is no Python is left out: its import is reported when it is executed.
    """
    found: dict[Path, None] = {}
    folders, others = own_folders(node), module_folders(node)
    waiting = [(node, text)]
    while waiting:
        path, content = waiting.pop()
        try:
            with _ONE_AT_A_TIME:
                tree = parse(content, path)
        except (SyntaxError, ValueError):
            continue
        imported = {own for statement in ast.walk(tree) for own in _of_import(statement, path, folders, others)}
        for each in sorted(imported):
            if each not in found and each != node.resolve():
                found[each] = None
                waiting.append((each, each.read_bytes()))
    return sorted(found)


def own_folders(node: Path) -> list[Path]:
    """Return a node's own folder, the one above its Python package, and that of its ROS package with its `src`."""
    folder = node.resolve().parent
    top = folder
    while (top / "__init__.py").is_file():
        top = top.parent
    found = [folder, top]
    for above in list(node.resolve().parents)[: _LEVELS + 1]:
        if any((above / file).is_file() for file in _PACKAGE):
            found += [above, above / "src"]
            break
    return list(dict.fromkeys(found))


def _of_import(statement: ast.AST, path: Path, folders: list[Path], others: list[Path]) -> Iterator[Path]:
    """Return the files that an import statement of a node's executes."""
    everywhere = [*folders, *others]
    if isinstance(statement, ast.Import):
        wanted = [(everywhere, each.name) for each in statement.names]
    elif isinstance(statement, ast.ImportFrom):
        places = [path.resolve().parents[statement.level - 1]] if statement.level else everywhere
        module = statement.module or ""
        wanted = [(places, module)] if module else []
        wanted += [(places, f"{module}.{each.name}".strip(".")) for each in statement.names]
    else:
        return
    for places, name in wanted:
        parts = name.split(".")
        for folder in places:
            if folder in others and not is_package_of_python(folder / parts[0]):
                continue
            place = folder.joinpath(*parts)
            with suppress(OSError):  # of a name that is too long
                file = place.with_suffix(".py") if place.with_suffix(".py").is_file() else place / "__init__.py"
                if file.is_file():
                    yield file.resolve()
                    break


def is_package_of_python(folder: Path) -> bool:
    """Return whether a folder of another package is what an import statement may name."""
    try:
        return (folder / "__init__.py").is_file()
    except OSError:  # a name that is too long
        return False


def _imports(node: ast.AST) -> Iterator[ast.Import | ast.ImportFrom]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, (ast.Import, ast.ImportFrom)):
            yield child
        elif not isinstance(child, ast.Try):
            yield from _imports(child)


def relocate_files(tree: ast.Module, node: Path, tell: Callable[[str, int], None]) -> None:
    """Put the places of files of data that a node names, and that are elsewhere, into its tree, and `tell` of them."""
    for parent in ast.walk(tree):
        called = _called(parent)
        if isinstance(parent, (ast.BinOp, ast.JoinedStr)) or called in _JOINING or _writes(parent):
            continue  # a part of a path, or a file that need not be there
        for each in ast.iter_child_nodes(parent):
            if not isinstance(each, ast.Constant) or not isinstance(each.value, str):
                continue
            if not each.value.startswith(("/", "~")) and called not in _READING:
                continue
            found = data_file(each.value, node)
            if found is not None:
                tell(f"{each.value} is not there; {found} is taken", each.lineno)
                each.value = str(found)


def _written_out(tree: ast.Module) -> Iterator[str]:
    """Yield the paths of files of data that are there and are written out in a file, but to be written to."""
    for parent in ast.walk(tree):
        for each in () if _writes(parent) else ast.iter_child_nodes(parent):
            if isinstance(each, ast.Constant) and isinstance(each.value, str) and len(each.value) <= _LONGEST_PATH:
                path = Path(each.value)
                if path.suffix.lower() in _DATA and is_file(path.expanduser() if each.value[0] == "~" else path):
                    yield each.value


def find_what_is_read(tree: ast.Module) -> None:
    """Let each path that a file reads go through FINDER: it may lie elsewhere, and is kept with what was read."""
    for call in ast.walk(tree):
        if not isinstance(call, ast.Call) or _called(call) not in _READING or _writes(call):
            continue
        if call.args and not isinstance(call.args[0], ast.Starred):
            call.args[0] = _found(call.args[0])
        for each in call.keywords:
            if each.arg in _FILE:
                each.value = _found(each.value)


def _found(path: ast.expr) -> ast.expr:
    return ast.fix_missing_locations(
        ast.copy_location(ast.Call(ast.copy_location(ast.Name(FINDER, ast.Load()), path), [path], []), path)
    )


def _writes(node: ast.AST) -> bool:
    """Return whether a call opens a file to write, or may."""
    if not isinstance(node, ast.Call) or _called(node) != "open":
        return False
    modes = [*node.args[1:2], *(each.value for each in node.keywords if each.arg == "mode")]
    return any(not (isinstance(each, ast.Constant) and str(each.value).startswith("r")) for each in modes)


def _called(node: ast.AST) -> str:
    """Return the name of the called function, or an empty string."""
    if not isinstance(node, ast.Call):
        return ""
    return node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")


def data_file(said: str, node: Path) -> Path | None:
    """Return where a node's file of data is, by the longest part of its path; None: where it says, or nowhere."""
    if len(said) > _LONGEST_PATH or any(each.isspace() and each != " " for each in said):
        return None
    path = Path(said)
    if path.suffix.lower() not in _DATA or path.expanduser().exists():
        return None
    parts = [part for part in path.parts if part not in ("/", "~", "..", ".")]
    folders = [node.resolve().parent, *list(node.resolve().parents)[1 : _LEVELS + 1]]
    for first in range(len(parts)):
        for folder in folders:
            found = folder.joinpath(*parts[first:])
            if found.is_file():
                return found
    return None
