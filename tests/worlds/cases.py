"""Many cases in one test, for what they share is paid once: setup, collection, and a report to the main process."""

from __future__ import annotations

import contextlib
import functools
import inspect
import shutil
import tempfile
from pathlib import Path

import pytest

START = Path.cwd()


def each(names, cases, ids=None, made=None):
    """Run a test once for each case, as `pytest.mark.parametrize` does, in one test; those that fail are named.

    `ids` makes a case's name; `made`, what the test gets of a case. A case that skips is left out, and the test skips
    if all do. The cases share the test's fixtures, but for what they write to folders, patch and print.
    """
    names = [name.strip() for name in names.split(",")] if isinstance(names, str) else list(names)
    cases = [case if len(names) > 1 else (case,) for case in cases]
    assert cases and all(len(case) == len(names) for case in cases), "a case has a value for each name"
    say = ids if callable(ids) else repr

    def decorate(test):
        parameters = inspect.signature(test).parameters
        assert set(names) <= set(parameters), f"{test.__name__} takes no {names}"

        @functools.wraps(test)
        def all_of_them(**fixtures):
            failed, skipped = [], []
            with kept(folders_of(fixtures)) as restore:
                for case in cases:
                    try:
                        with as_new(fixtures) as own:
                            values = case if made is None else map(made, case)
                            test(**own, **dict(zip(names, values, strict=True)))
                    except pytest.skip.Exception as skip:
                        skipped.append(skip)
                    except (Exception, pytest.fail.Exception) as error:
                        failed.append((", ".join(f"{say(value)}"[:200] for value in case), error))
                    if case is not cases[-1]:
                        restore()
            if failed:
                said = "\n".join(f"  {name}: {type(error).__name__}: {error}" for name, error in failed)
                raise AssertionError(f"{len(failed)} of {len(cases)} cases:\n{said}") from failed[0][1]
            if len(skipped) == len(cases):
                raise skipped[0]

        own = [parameter for name, parameter in parameters.items() if name not in names]
        all_of_them.__signature__ = inspect.Signature(own)
        return all_of_them

    return decorate


@contextlib.contextmanager
def as_new(fixtures):
    """Fixtures of one case: a monkeypatch of its own, and nothing printed before it."""
    for name in ("capsys", "capfd"):
        if name in fixtures:
            fixtures[name].readouterr()
    with pytest.MonkeyPatch.context() as patch:
        yield fixtures | ({"monkeypatch": patch} if "monkeypatch" in fixtures else {})


def folders_of(fixtures):
    """The folders among the fixtures, and the present one where a fixture has changed to it; none inside another."""
    found = {value for value in fixtures.values() if isinstance(value, Path) and value.is_dir()}
    found |= {Path.cwd()} - {START}
    return [folder for folder in found if not found & {*folder.parents}]


@contextlib.contextmanager
def kept(folders):
    """Copies of folders; what is yielded gives them back their contents."""
    with tempfile.TemporaryDirectory(prefix="cases-") as aside:
        copies = {folder: Path(aside, f"{number}") for number, folder in enumerate(folders)}
        for folder, copy in copies.items():
            shutil.copytree(folder, copy, symlinks=True)

        def restore():
            for folder, copy in copies.items():
                for path in [*folder.rglob("*")]:
                    if path.is_dir() and not path.is_symlink():
                        path.chmod(0o700)
                for path in folder.iterdir():
                    shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()
                shutil.copytree(copy, folder, symlinks=True, dirs_exist_ok=True)

        yield restore
