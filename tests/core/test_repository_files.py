"""The files that hosts and tools read: they parse, what they name exists, and versions are those of pyproject.toml."""

import importlib.util
import os
import re
import sys
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import pytest

from fg_mujoco.pictures.rendering import gl

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).parents[2]
yaml = pytest.importorskip("yaml")
if not (ROOT / "pyproject.toml").exists():
    pytest.skip("not a checkout of the repository", allow_module_level=True)
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
LEAST_PYTHON = tuple(map(int, PROJECT["requires-python"].removeprefix(">=").split(".")))


def read(path):
    return yaml.safe_load((ROOT / path).read_text("utf-8"))


def version_of(text):
    return tuple(map(int, text.split(".")))


def test_the_citation_has_the_version_and_licence_of_the_package():
    citation = read("CITATION.cff")
    assert citation["cff-version"] == "1.2.0" and citation["type"] == "software"
    assert (citation["version"], citation["license"]) == (PROJECT["version"], PROJECT["license"])
    assert citation["keywords"] == PROJECT["keywords"]
    assert all(citation[name] for name in ("message", "title", "authors"))


def test_the_hook_is_the_lint_of_this_checkout_and_names_no_other_repository():
    (repository,) = read(".pre-commit-config.yaml")["repos"]
    (hook,) = repository["hooks"]
    assert (repository["repo"], hook["entry"], hook["language"]) == ("local", "make lint", "system")
    assert re.search("^lint:", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE)


def test_the_workflow_runs_the_whole_check_on_every_python_that_is_accepted_and_the_tests_on_the_newest_mujoco():
    jobs = read(".github/workflows/test.yml")["jobs"]
    job, newest = jobs["test"], jobs["mujoco4"]
    pythons = [version_of(text) for text in job["strategy"]["matrix"]["python"]]
    assert pythons[0] == LEAST_PYTHON
    assert pythons == [(3, minor) for minor in range(LEAST_PYTHON[1], pythons[-1][1] + 1)]
    assert [step["run"] for step in job["steps"] if "run" in step] == [".ci/run"]
    assert [step["run"] for step in newest["steps"] if "run" in step] == [".ci/run mujoco4"]
    assert re.search("^mujoco4:", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE)
    assert os.access(ROOT / ".ci" / "run", os.X_OK)


def test_the_container_has_a_python_that_is_accepted_and_copies_what_there_is():
    text = (ROOT / "Containerfile").read_text("utf-8")
    assert version_of(re.search(r"^FROM python:([\d.]+)-", text, re.MULTILINE)[1]) >= LEAST_PYTHON
    copied = {name for line in re.findall(r"^COPY (.*) \S+$", text, re.MULTILINE) for name in line.split()}
    assert all((ROOT / name).exists() for name in copied)
    assert {"fg_mujoco", "models", "tracks", "controllers", "addons", "native", "pyproject.toml", "README.md"} <= copied
    extras = re.search(r"/source\[([\w,]+)\]", text)[1].split(",")
    assert set(extras) <= set(PROJECT["optional-dependencies"])


def test_the_container_installs_the_libraries_that_messages_ask_for():
    text = (ROOT / "Containerfile").read_text("utf-8")
    packages = set(re.search(r"apt-get install -y --no-install-recommends (.*) \\", text)[1].split())
    commands = {gl.INSTALL_COMMAND, *gl._INSTALL_COMMANDS.values()}
    assert packages == {name for command in commands for name in command.split("recommends ")[1].split()}
    assert "never been built" in text


def test_the_security_page_names_options_and_files_that_there_are():
    text = (ROOT / "SECURITY.md").read_text("utf-8")
    code = "".join(path.read_text("utf-8") for path in (ROOT / "fg_mujoco").rglob("*.py"))
    code += "".join(path.read_text("utf-8") for path in (ROOT / "addons").rglob("*.py"))
    for name in ("outside_folder", "controller.py", "states.npz", "scene.xml", "--host", "--config"):
        assert name in text and name in code
    assert "allow_pickle=True" not in code
    # one place reads YAML, by a loader that makes plain values only and refuses more than the safe one
    assert re.findall(r"yaml\.\w*load\w*\([^\n]*", code) == ["yaml.load(text, loader or plain_loader())"]
    assert "class PlainLoader(yaml.SafeLoader)" in code and re.findall(r"plain_yaml\(\w+, (\w+)\)", code) == ["Loader"]
    assert set(re.findall(r"class Loader\((.*)\):", code)) == {"plain_loader()", "plain_loader(file)"}


def test_an_install_that_did_not_end_names_what_is_missing(monkeypatch):
    spec = importlib.util.spec_from_file_location("missing", ROOT / "tools" / "missing.py")
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    there = {"numpy": "1.26.4", "mujoco": "3.17.0"}  # whose NumPy gives other last bits

    def version(name):
        if name in there:
            return there[name]
        raise PackageNotFoundError(name)

    monkeypatch.setattr(tool, "version", version)
    found = tool.missing(["plot"])
    assert {"numpy", "matplotlib"} <= set(found), "numpy is there, but too old"
    assert not {"mujoco", "ray", "tomli" if sys.version_info >= (3, 11) else ""} & set(found)
