"""Makes a release: tests, builds and tries it in a clone, then commits and tags the version here.

python release.py 0.2.0 [--dry-run] [--no-tests] [--offline]

The working tree is changed only at the end: the version in pyproject.toml and CITATION.cff, the date in CHANGELOG.md,
one commit and one tag. Nothing is pushed. A failure before that leaves everything as it was.
"""

from __future__ import annotations

import argparse
import datetime
import os
import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import venv
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent
UNRELEASED = "(not released yet)"
VERSION = re.compile(r"\d+\.\d+\.\d+")
PLACES = {"pyproject.toml": r'^version = "(.*)"$', "CITATION.cff": r'^version: "(.*)"$'}
STEPS = {
    "test": "make test",
    "build": "rm -rf dist && {python} -m pip wheel --quiet --disable-pip-version-check --no-deps --no-build-isolation "
    "-w dist . && {python} -c \"from scikit_build_core.build import build_sdist; build_sdist('dist')\" > /dev/null",
    "try": "{python} {script} --try-wheel {version} {offline}",
    "docs": "NO_MKDOCS_2_WARNING=1 {python} -m mkdocs build --strict --quiet",
}
"""Name of a step -> its shell command. The first runs in the repository, the others in the clone."""


class RefusalError(Exception):
    """A release that cannot be made; its text is one line."""


def run(*words: str, cwd: Path = ROOT) -> str:
    """Return what a command prints; raise RefusalError if it fails."""
    done = subprocess.run(words, cwd=cwd, capture_output=True, text=True)
    if done.returncode:
        said = (done.stderr or done.stdout).strip().splitlines() or ["it says nothing"]
        raise RefusalError(f"{shlex.join(words)} failed: {said[-1]}")
    return done.stdout.strip()


def numbers(version: str) -> tuple[int, ...]:
    """Return the numbers of a version, which are compared."""
    return tuple(map(int, version.split(".")))


def section(changelog: str) -> tuple[str, str]:
    """Return the first heading of the changelog, and what stands below it."""
    _, _, rest = changelog.partition("\n## ")
    heading, _, text = rest.partition("\n")
    return heading, text.partition("\n## ")[0].strip()


def check(version: str) -> None:
    """Refuse a version that cannot be released from this working tree."""
    if not VERSION.fullmatch(version):
        raise RefusalError(f"VERSION is {version!r}; accepted: three numbers, such as 0.2.0")
    changed = run("git", "status", "--porcelain").splitlines()
    if changed:
        first = changed[0].split(maxsplit=1)[1]
        raise RefusalError(f"the working tree has {len(changed)} uncommitted changes, such as {first}")
    tagged = [tag[1:] for tag in run("git", "tag", "--list", "v*").split() if VERSION.fullmatch(tag[1:])]
    if version in tagged:
        raise RefusalError(f"version {version} is there already, as the tag v{version}")
    newest = max((*tagged, "0.0.0"), key=numbers)
    if numbers(version) <= numbers(newest):
        raise RefusalError(f"version {version} is not greater than {newest}, the newest tag")
    here = re.search(PLACES["pyproject.toml"], (ROOT / "pyproject.toml").read_text("utf-8"), re.MULTILINE)
    if here is not None and numbers(version) < numbers(here[1]):
        raise RefusalError(f"version {version} is not greater than {here[1]}, that of pyproject.toml")
    heading, text = section((ROOT / "CHANGELOG.md").read_text("utf-8"))
    if heading.split(" ")[0] != version or not text:
        needed = f"'{version} {UNRELEASED}' and its changes"
        raise RefusalError(f"the first section of CHANGELOG.md is '{heading}'; needed: {needed}")


def set_version(folder: Path, version: str) -> None:
    """Write the version, and today's date as that of its changes, to the files of a folder."""
    for name, pattern in PLACES.items():
        text = (folder / name).read_text("utf-8")
        found = re.search(pattern, text, re.MULTILINE)
        if found is None:
            raise RefusalError(f"{name} has no line with a version")
        (folder / name).write_text(text[: found.start(1)] + version + text[found.end(1) :], "utf-8")
    changelog = folder / "CHANGELOG.md"
    today = f"({datetime.date.today().isoformat()})"
    changelog.write_text(changelog.read_text("utf-8").replace(UNRELEASED, today, 1), "utf-8")


def try_wheel(version: str, *, offline: bool) -> None:
    """Install the wheel of dist/ in an empty virtual environment, and race a lap with it in an empty folder.

    Offline, the packages that it needs are those of this Python.
    """
    (wheel,) = Path("dist").resolve().glob(f"*-{version}-*.whl")
    with tempfile.TemporaryDirectory() as temporary:
        there, empty = Path(temporary, "venv"), Path(temporary, "empty")
        empty.mkdir()
        venv.create(there, with_pip=True)
        python = str(there / "bin" / "python")
        options = ["-c", str(Path("constraints.txt").resolve())]
        if offline:
            options = ["--no-deps", "--no-index"]
            site = Path(sysconfig.get_path("purelib", vars={"base": str(there)}))
            shared = (path for path in sys.path if path.endswith("site-packages"))
            (site / "shared.pth").write_text("\n".join(shared) + "\n", "utf-8")
        run(python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *options, str(wheel))
        command = str(there / "bin" / "fg-mujoco")
        said = run(command, "--version", cwd=empty)
        if said != f"fg-mujoco {version}":
            raise RefusalError(f"the installed wheel says that it is {said!r}")
        print(run(command, "race", "--laps", "1", cwd=empty))
        left = [path.name for path in empty.iterdir()]
        if left:
            raise RefusalError(f"a race leaves {left[0]} in the folder that it is started from")


def release(version: str, steps: dict[str, str], *, dry_run: bool, offline: bool) -> None:
    """Check, test, build, try and tag a version."""
    check(version)
    words = {"python": shlex.quote(sys.executable), "script": shlex.quote(str(Path(__file__).resolve()))}
    words |= {"version": version, "offline": "--offline" if offline else ""}
    with tempfile.TemporaryDirectory() as temporary:
        clone = Path(temporary, "clone")
        run("git", "clone", "--quiet", "--no-hardlinks", str(ROOT), str(clone))
        set_version(clone, version)
        for name, command in steps.items():
            print(f"{name} ...", flush=True)
            shell = command.format(**words) if command == STEPS[name] else command
            if subprocess.run(shell, shell=True, cwd=ROOT if name == "test" else clone).returncode:
                raise RefusalError(f"the step '{name}' failed; nothing has been changed")
        if dry_run:
            print(f"{version} can be released; nothing has been changed")
            return
        for made in ("dist", "build/site"):
            if (clone / made).is_dir():
                shutil.copytree(clone / made, ROOT / made, dirs_exist_ok=True)
    files = [*PLACES, "CHANGELOG.md"]
    try:
        set_version(ROOT, version)
        run("git", "commit", "--quiet", "--allow-empty", "-m", f"Version {version}", "--", *files)
    except BaseException:
        run("git", "checkout", "--quiet", "HEAD", "--", *files)
        raise
    run("git", "tag", "-a", f"v{version}", "-m", f"Version {version}")
    print(f"{version} is committed and tagged; the wheel and the sdist are in dist/, the site in build/site")
    print(f"to push: git push origin HEAD v{version}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code: 0, or 1 with one line that says why there is no release."""
    parser = argparse.ArgumentParser(description="Makes a release.", allow_abbrev=False)
    parser.add_argument("version", metavar="VERSION", help="such as 0.2.0")
    parser.add_argument("--dry-run", action="store_true", help="do all but the commit and the tag; nothing is changed")
    parser.add_argument("--no-tests", action="store_true", help="do not run `make test` first")
    parser.add_argument("--offline", action="store_true", help="try the wheel with the packages of this Python")
    parser.add_argument(
        "--replace", action="append", default=[], metavar="STEP=COMMAND",
        help=f"another shell command for a step: {', '.join(STEPS)}",
    )  # fmt: skip
    parser.add_argument("--try-wheel", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args(arguments)
    steps = dict(STEPS)
    for each in given.replace:
        name, _, command = each.partition("=")
        if name not in steps:
            parser.error(f"--replace {name}; accepted: {', '.join(STEPS)}")
        steps[name] = command
    if given.no_tests:
        del steps["test"]
    os.environ.pop("PYTHONPATH", None)
    try:
        if given.try_wheel:
            try_wheel(given.version, offline=given.offline)
        else:
            release(given.version, steps, dry_run=given.dry_run, offline=given.offline)
    except RefusalError as refusal:
        print(f"release: {refusal}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
