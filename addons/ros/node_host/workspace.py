"""Packages of a ROS workspace, as it lies on disk: folders with a package.xml, found from a file of one of them.

Nothing is executed, and nothing built: what `setup.py` would install is read off its text.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

_LEVELS = 6  # folders above a file in which its package is looked for
_DEEP = 5  # folders below a workspace in which packages are looked for
_MOST_FOLDERS = 1000  # that are looked through for packages: a workspace may lie in a folder of all else
_SKIPPED = ("build", "install", "log", "devel", "node_modules", "site-packages")
_NAME = re.compile(r"<name>\s*([\w-]+)\s*</name>")
_LAUNCH = {
    ".py": rb"^def generate_launch_description\b", ".xml": rb"<launch\b",
    **dict.fromkeys((".yaml", ".yml"), rb"^launch\s*:"),
}  # fmt: skip
"""Endings of launch files, and what one has in it."""
_SCRIPT_FOLDERS = ("scripts", "src", "nodes", "script", "node", "bin", "")


def own_package(file: Path) -> Path | None:
    """Return the folder of the package that a file is in; None where it is in none."""
    return next((above for above in list(file.resolve().parents)[:_LEVELS] if (above / "package.xml").is_file()), None)


def packages(file: Path) -> dict[str, Path]:
    """Return the packages of the workspace that a file is in, by name: its own first, then those that lie less deep.

    The workspace is the nearest folder `src` that the package is in, else the repository, else the folder that the
    package lies in; of a file that is in no package its repository, else its own folder.
    """
    own = own_package(file)
    start = file.resolve() if own is None else own
    above = list(start.parents)[:_LEVELS]
    root = next((each for each in above if own is not None and each.name == "src"), None)
    root = root or next((each for each in above if (each / ".git").exists()), start.parent)
    found: dict[str, Path] = {}
    for folder in (*([] if own is None else [own, *_below(own)]), *_below(root)):
        found.setdefault(package_name(folder), folder)
    return found


def package_name(folder: Path) -> str:
    """Return the name that a package's package.xml gives; that of its folder where it gives none."""
    try:
        found = _NAME.search((folder / "package.xml").read_text("utf-8", "replace"))
    except OSError:
        found = None
    return found.group(1) if found else folder.name


def module_folders(file: Path) -> list[Path]:
    """Return the folders in which the Python packages of the other packages of a file's workspace lie."""
    own = own_package(file)
    return [place for folder in packages(file).values() if folder != own for place in (folder, folder / "src")]


def executable(package: Path, name: str) -> tuple[Path, str] | None:
    """Return the Python file and entry point of an executable, empty: the file itself; None: there is no such file."""
    for said, module, function in _entry_points(package):
        if said == name:
            found = _module_file(package, module)
            return None if found is None else (found, function)
    text = _cmake(package)
    if re.search(rf"\badd_executable\s*\(\s*{re.escape(name)}\s", text):
        return None  # of C++
    inner = package / package_name(package)
    folders = (*(package / each for each in _SCRIPT_FOLDERS), inner)
    named = (folder / each for folder in folders for each in (name, f"{name}.py"))
    anywhere = (each for each in _files(package) if each.name in (name, f"{name}.py"))
    for file in (*(package / each for each in _installed(text, name)), *named, *anywhere):
        if file.is_file() and _is_python(file):
            return file, ""
    return None


def _cmake(package: Path) -> str:
    """Return the text of a package's CMakeLists.txt, without comments and quotes; none where there is no such file."""
    file = package / "CMakeLists.txt"
    text = re.sub(r"#.*", "", file.read_text("utf-8", "replace")) if file.is_file() else ""
    return text.replace("${PROJECT_NAME}", package_name(package)).replace('"', " ")


def _installed(text: str, name: str) -> Iterator[str]:
    """Yield the files that a CMakeLists.txt names and that may be installed as an executable of a name."""
    renamed = re.findall(rf"([^\s(]+)(?:\s+DESTINATION\s+[^\s)]+)?\s+RENAME\s+{re.escape(name)}[\s)]", text)
    for said in (*renamed, *re.findall(rf"[^\s(]*(?<![\w.-]){re.escape(name)}(?:\.py)?(?=[\s)])", text)):
        yield re.sub(r"\$\{\w+\}/?", "", said).lstrip("/")


def may_start(launch: Path) -> list[Path]:
    """Return the Python files that a launch file may start, itself first: of its package, and those that one names."""
    own, names, found = own_package(launch), packages(launch), {launch.resolve(): None}
    for folder in list(names.values()):
        inits = [*folder.glob("*/__init__.py"), *folder.glob("src/*/__init__.py")]
        names = {**{each.parent.name: folder for each in inits}, **names}
    found.update(dict.fromkeys(_python_files(own) if own else sorted(launch.resolve().parent.glob("*.py"))))
    waiting = list(found)
    while waiting:
        for word in set(re.findall(r"[A-Za-z][\w-]*", waiting.pop().read_text("utf-8", "replace"))):
            if word in names:
                new = [each for each in _python_files(names.pop(word)) if each not in found]
                found.update(dict.fromkeys(new))
                waiting += new
    return list(found)


def _python_files(package: Path) -> list[Path]:
    """Return the Python and launch files of a package, sorted."""
    found = [each.resolve() for each in _files(package) if each.is_file()]
    return sorted(each for each in found if is_launch_file(each) or _is_python(each))


def _files(package: Path) -> Iterator[Path]:
    """Yield the files of a package that may be programs: without an ending, Python, XML or YAML."""
    for folder, inner, files in os.walk(package):
        inner[:] = sorted(each for each in inner if each[0] != "." and each not in _SKIPPED)
        yield from (Path(folder, each) for each in sorted(files) if Path(each).suffix in ("", ".py", *_LAUNCH))


def is_launch_file(path: Path) -> bool:
    """Return whether a file is a launch file of ROS 2, in Python, XML or YAML."""
    begins = _LAUNCH.get(path.suffix)
    try:
        return begins is not None and re.search(begins, path.read_bytes(), re.MULTILINE) is not None
    except OSError:
        return False


def _entry_points(package: Path) -> Iterator[tuple[str, str, str]]:
    """Yield name, module and function of the console scripts of setup.py or setup.cfg."""
    for file in (package / "setup.py", package / "setup.cfg"):
        if file.is_file():
            text = file.read_text("utf-8", "replace")
            lines = [line for line in text.splitlines() if not line.lstrip().startswith("#")]
            for found in re.finditer(r"([\w.-]+)\s*=\s*([A-Za-z_][\w.]*)\s*:\s*(\w+)", "\n".join(lines)):
                yield found.group(1), found.group(2), found.group(3)


def _module_file(package: Path, module: str) -> Path | None:
    parts = module.split(".")
    for root in (package, package / "src"):
        place = root.joinpath(*parts)
        for file in (place.parent / f"{place.name}.py", place / "__init__.py"):
            if file.is_file():
                return file
    return None


def _below(folder: Path) -> list[Path]:
    """Return the packages in a folder, of which none is looked for within another: those that lie less deep first."""
    found: list[Path] = []
    level, looked = [folder], 0
    for depth in range(_DEEP + 1):
        deeper: list[Path] = []
        for each in level:
            looked += 1
            if looked > _MOST_FOLDERS:
                return found
            with suppress(OSError), os.scandir(each) as entries:
                inner = list(entries)
                if depth and any(entry.name == "package.xml" for entry in inner):
                    found.append(each)
                    continue
                folders = (entry for entry in inner if entry.name[0] != "." and entry.name not in _SKIPPED)
                deeper += sorted(Path(entry.path) for entry in folders if entry.is_dir())
        level = deeper
    return found


def _is_python(file: Path) -> bool:
    with file.open("rb") as opened:
        first = opened.readline(200)
    return file.suffix == ".py" or (first.startswith(b"#!") and b"python" in first)
