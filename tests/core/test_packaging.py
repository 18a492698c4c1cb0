import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

import fg_mujoco as fg

ROOT = Path(__file__).parents[2]
FOLDERS = ("fg_mujoco", "models", "tracks", "controllers", "addons")
BESIDE = ("pyproject.toml", "README.md", "LICENSE", "CHANGELOG.md", "CITATION.cff", "constraints.txt")
PYPROJECT = (ROOT / "pyproject.toml").read_text() if (ROOT / "pyproject.toml").exists() else ""

needs_checkout = pytest.mark.skipif(not PYPROJECT, reason="not a checkout of the repository")


def files_in(*folders):
    """Every file of some folders, as paths in the repository."""
    return {
        path.relative_to(ROOT).as_posix()
        for folder in folders
        for path in (ROOT / folder).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts and path.suffix != ".so"
    }


def installed_name(path):
    """Where a file of the repository goes in site-packages."""
    return path if path.startswith("fg_mujoco/") else f"fg_mujoco/{path}"


LAUNCHER = """#!/bin/sh
for word; do [ "$before" != -o ] || object=$word; before=$word; done
kept="{objects}/${{PWD##*/}}/$object"
if [ -f "$kept" ]; then cp "$kept" "$object"; else exec "$@"; fi
"""
"""What CMake calls to compile: it takes an object that the build of the checkout has made of the same source."""


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """A folder with the sdist of this checkout, and the wheel that is built of the sdist: no network is needed."""
    for name, version in (("scikit_build_core", "1.1"), ("nanobind", "3.1")):
        pytest.importorskip(name, minversion=version, reason="older than pyproject.toml says; make test renews it")
    folder = tmp_path_factory.mktemp("built")
    source = folder / "source"
    for name in (*FOLDERS, "native"):
        shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in BESIDE:
        shutil.copy(ROOT / name, source)
    (source / "tests").mkdir()
    shutil.copy(Path(__file__), source / "tests")  # of which nothing belongs into either

    launcher = tmp_path_factory.mktemp("launcher") / "launcher"
    launcher.write_text(LAUNCHER.format(objects=ROOT / "build" / "native"))
    launcher.chmod(0o755)
    environment = os.environ | ({"CMAKE_CXX_COMPILER_LAUNCHER": str(launcher)} if os.name == "posix" else {})

    def build(what, where):
        program = f"import sys; sys.path.insert(0, 'native'); import build_backend as b; b.{what}({str(folder)!r})"
        command = [sys.executable, "-c", program]
        made = subprocess.run(command, cwd=where, env=environment, capture_output=True, text=True)
        assert made.returncode == 0, made.stdout[-2000:] + made.stderr[-2000:]

    build("build_sdist", source)
    (sdist,) = folder.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        archive.extractall(folder / "unpacked", filter="data")
    (unpacked,) = (folder / "unpacked").iterdir()
    build("build_wheel", unpacked)
    return folder


@needs_checkout
def test_wheel_and_sdist_hold_every_file_and_nothing_else(built):
    (wheel,) = built.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
        (library,) = (name for name in names if name.startswith("fg_mujoco/_native.") and not name.endswith(".pyi"))
        assert names - {library} == {installed_name(path) for path in files_in(*FOLDERS)}
        assert any(name.endswith("licenses/LICENSE") for name in archive.namelist())
    (sdist,) = built.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        files = {
            member.name.partition("/")[2]: archive.extractfile(member).read()
            for member in archive.getmembers()
            if member.isfile()
        }
    assert files.keys() - {"PKG-INFO"} == files_in(*FOLDERS, "native") | set(BESIDE)
    assert all((ROOT / name).read_bytes() == text for name, text in files.items() if name != "PKG-INFO")


@needs_checkout
def test_the_version_of_pyproject_is_that_of_the_archives_and_of_the_changelog(built):
    version = re.search(r'^version = "(.*)"$', PYPROJECT, re.MULTILINE)[1]
    sdist, wheel = sorted((path.name for path in built.iterdir() if path.is_file()), key=len)
    assert sdist == f"fg_mujoco-{version}.tar.gz" and wheel.startswith(f"fg_mujoco-{version}-cp3")
    newest = re.search(r"^## (.*)$", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)[1]
    assert newest.split(" ")[0] == version or newest.endswith(" (not released yet)")
    assert fg.__version__ == version


@needs_checkout
@pytest.mark.slow
def test_what_pip_installs_from_the_wheel_races_away_from_the_repository(built, tmp_path):
    """Dependencies are those of this Python; without network, so nothing is fetched."""
    pytest.importorskip("pip")
    site, empty = tmp_path / "site", tmp_path / "empty"
    empty.mkdir()
    environment = os.environ | {"PYTHONPATH": str(site)}

    def python(*arguments):
        done = subprocess.run([sys.executable, *arguments], cwd=empty, env=environment, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
        return done.stdout

    (archive,) = built.glob("*.whl")  # what pip makes of the sdist is that
    pip = ("-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--no-build-isolation", "--no-compile")
    python(*pip, "--disable-pip-version-check", "--target", str(site), str(archive))
    installed = {path.relative_to(site).as_posix() for path in site.rglob("*") if path.is_file()}
    assert {installed_name(path) for path in files_in(*FOLDERS)} <= installed
    where = "import fg_mujoco, fg_mujoco.controllers.gap_finder as g; print(fg_mujoco.__file__, g.__file__)"
    race = "import runpy; runpy.run_module('fg_mujoco', run_name='__main__')"  # as `python -m fg_mujoco`
    files, line = python("-c", f"{where}; {race}", "race", "--laps", "1", "--json").split("\n", 1)
    assert all(name.startswith(str(site)) for name in files.split())
    assert json.loads(line)["finished"] is True
    assert list(empty.iterdir()) == []


@needs_checkout
def test_constraints_name_versions_and_no_addresses():
    lines = [line for line in (ROOT / "constraints.txt").read_text().splitlines() if not line.startswith("#")]
    assert all(re.fullmatch(r'[A-Za-z0-9._-]+==[0-9a-z.]+(; python_version (>=|<) "3\.11")?', line) for line in lines)
    pinned = {line.partition("==")[0].lower().replace("_", "-") for line in lines}
    needed = set(re.findall(r'"([A-Za-z-]+)>=', PYPROJECT))
    assert needed <= pinned
