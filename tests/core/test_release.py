"""A release is made from a clean tree with a new version and its changes; whatever is wrong is said in one line."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from cases import each

ROOT = Path(__file__).parents[2]
if not (ROOT / "release.py").exists():
    pytest.skip("not a checkout of the repository", allow_module_level=True)
FILES = ("release.py", "pyproject.toml", "CITATION.cff", "CHANGELOG.md")
CHANGES = "# Changes\n\n## 7.2.0 (not released yet)\n\n- Something new.\n\n## 7.1.0 (2026-01-01)\n\n- The first.\n"
WHO = {f"GIT_{who}_{what}": "someone" for who in ("AUTHOR", "COMMITTER") for what in ("NAME", "EMAIL")}
QUICK = ("--replace", "test=true", "--replace", "build=mkdir dist && cp pyproject.toml dist/there", "--replace",
         "try=true", "--replace", "docs=true")  # fmt: skip


@pytest.fixture
def clone(tmp_path, monkeypatch):
    """A repository with the files that a release changes, at version 7.1.0."""
    for name, value in WHO.items():
        monkeypatch.setenv(name, value)
    for name in ("GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE"):
        monkeypatch.delenv(name, raising=False)
    folder = tmp_path / "clone"
    folder.mkdir()
    for name in FILES:
        text = (ROOT / name).read_text("utf-8")
        text = re.sub(r'^(version(?: =|:) ")[^"]*', r"\g<1>7.1.0", text, flags=re.MULTILINE)
        (folder / name).write_text(CHANGES if name == "CHANGELOG.md" else text, "utf-8")
    (folder / ".gitignore").write_text("dist/\nbuild/\n")
    git(folder, "init", "--quiet", "-b", "main")
    git(folder, "add", ".")
    git(folder, "commit", "--quiet", "-m", "First")
    git(folder, "tag", "v7.1.0")
    return folder


def git(folder, *words):
    return subprocess.run(["git", *words], cwd=folder, capture_output=True, text=True, check=True).stdout


def made(folder, *words):
    done = subprocess.run([sys.executable, "release.py", *words], cwd=folder, capture_output=True, text=True)
    return done.returncode, done.stdout, done.stderr


def everything(folder):
    files = {path.name: path.read_text("utf-8") for path in folder.iterdir() if path.is_file()}
    return files, git(folder, "log", "--format=%H"), git(folder, "tag"), sorted(path.name for path in folder.iterdir())


def test_a_release_is_built_from_the_new_version_committed_and_tagged(clone):
    code, said, wrong = made(clone, "7.2.0", *QUICK)
    assert (code, wrong) == (0, "")
    assert said.splitlines()[-1] == "to push: git push origin HEAD v7.2.0"
    assert git(clone, "status", "--porcelain") == ""
    assert git(clone, "log", "-1", "--format=%s %D") == "Version 7.2.0 HEAD -> main, tag: v7.2.0\n"
    for name in ("pyproject.toml", "CITATION.cff"):
        text = (clone / name).read_text()
        assert re.search(r'^version(?: =|:) "7\.2\.0"$', text, re.MULTILINE) and "7.1.0" not in text
    assert re.search(r"^## 7\.2\.0 \(\d{4}-\d\d-\d\d\)$", (clone / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert (clone / "dist" / "there").read_text() == (clone / "pyproject.toml").read_text()


def test_a_dry_run_leaves_everything_as_it_was(clone):
    before = everything(clone)
    code, said, _ = made(clone, "7.2.0", "--dry-run", *QUICK)
    assert code == 0 and said.splitlines()[-1] == "7.2.0 can be released; nothing has been changed"
    assert everything(clone) == before


@each("step", ["build", "docs"])
def test_a_step_that_fails_leaves_everything_as_it_was(clone, step):
    before = everything(clone)
    code, _, wrong = made(clone, "7.2.0", *QUICK, "--replace", f"{step}=false")
    assert (code, wrong) == (1, f"release: the step '{step}' failed; nothing has been changed\n")
    assert everything(clone) == before


@each(
    ("version", "said"),
    [
        ("7.2", "VERSION is '7.2'; accepted: three numbers, such as 0.2.0"),
        ("7.1.0", "version 7.1.0 is there already, as the tag v7.1.0"),
        ("7.0.9", "version 7.0.9 is not greater than 7.1.0, the newest tag"),
        (
            "7.3.0",
            "the first section of CHANGELOG.md is '7.2.0 (not released yet)'; "
            "needed: '7.3.0 (not released yet)' and its changes",
        ),
    ],
)
def test_a_version_that_cannot_be_released_is_refused_in_one_line(clone, version, said):
    before = everything(clone)
    assert made(clone, version, *QUICK) == (1, "", f"release: {said}\n")
    assert everything(clone) == before


def test_a_tree_with_changes_is_refused_in_one_line(clone):
    (clone / "new.txt").write_text("new")
    said = "release: the working tree has 1 uncommitted changes, such as new.txt\n"
    assert made(clone, "7.2.0", *QUICK) == (1, "", said)
