"""The documentation works: its Python runs, its commands are accepted, its links lead somewhere, and it is complete."""

import ast
import importlib
import json
import re
import shlex
import subprocess
import sys
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest

import fg_mujoco as fg
from fg_mujoco.cli.main import _parser, main
from fg_mujoco.course.files import tomllib
from fg_mujoco.errors import MissingExtraError
from fg_mujoco.lab.experiment import LabSettings
from fg_mujoco.lab.skidpad import SETS
from fg_mujoco.vehicle.tires import tire_names
from rendered import needs_gl

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
if not (ROOT / "mkdocs.yml").exists():
    pytest.skip("not a checkout of the repository", allow_module_level=True)

READ = [path for path in DOCS.rglob("*.md") if "journal" not in path.parts]  # the journal is about older versions
PAGES = sorted(path.relative_to(ROOT).as_posix() for path in (*READ, *ROOT.glob("[CR]*.md")))
CONFIG = (ROOT / "mkdocs.yml").read_text("utf-8")
RUN_ELSEWHERE = {
    f"docs/{page}": "tests/addons/learn/test_training_example.py"
    for page in ("environments.md", "addons/learn/training.md", "addons/learn/policies.md")
}
ONLY_IMPORTED = {
    "docs/rendering.md": "goes on from a run folder, a world and a simulation of the reader's, with OpenGL"
}
NEEDS = {
    "docs/api/tracks.md": ("PIL", "yaml", "skimage"),
    "docs/addons/learn/api.md": ("pettingzoo",), "docs/api/rendering.md": ("matplotlib", "PIL"),
}  # fmt: skip

ENTRY_POINT_GROUPS = {  # names for other packages, not modules
    "fg_mujoco.scenes", "fg_mujoco.controllers", "fg_mujoco.tires", "fg_mujoco.vehicles", "fg_mujoco.track_formats",
    "fg_mujoco.rewards", "fg_mujoco.end_conditions", "fg_mujoco.observations", "fg_mujoco.sensors",
    "fg_mujoco.speed_laws", "fg_mujoco.tire_laws",
}  # fmt: skip

BLOCK = re.compile(r'^```(\w+)(?: title="([^"]+)")?\n(.*?)^```', re.MULTILINE | re.DOTALL)


def blocks(page, language):
    """Return the code blocks of a page in a language: file name, or "", and text."""
    return [(title, code) for kind, title, code in BLOCK.findall((ROOT / page).read_text("utf-8")) if kind == language]


def module_of_docs(name):
    spec = spec_from_file_location(name, DOCS / f"{name}.py")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def hooks():
    return module_of_docs("site_hooks")


@pytest.fixture(scope="module")
def tables():
    return module_of_docs("tables")


def without_old_names(page):
    """Return the text of a page; of a table that begins with a column "before" only the other columns."""
    lines, old = [], False
    for line in (ROOT / page).read_text("utf-8").splitlines():
        old = line.startswith("| before |") or (old and line.startswith("|"))
        lines.append(line.split(" | ", 1)[1] if old else line)
    return "\n".join(lines)


def imported(dotted):
    """Return whether a dotted name is a module, or a name in one."""
    module, _, rest = dotted.partition(".")
    found = importlib.import_module(module)
    for name in filter(None, rest.split(".")):
        try:
            module = f"{module}.{name}"
            found = importlib.import_module(module)
        except MissingExtraError:  # it is there, and names the extra that it needs
            return True
        except ImportError:
            if not hasattr(found, name):
                return False
            found = getattr(found, name)
    return True


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, marks=needs_gl if page == "docs/api/rendering.md" else ())
        for page in PAGES
        if blocks(page, "python") and page not in RUN_ELSEWHERE | ONLY_IMPORTED
    ],
)
def test_python_of_a_page_runs_in_an_empty_folder(page, tmp_path, monkeypatch, capsys):
    """One block goes on where the last one ended; one with a title is written to that file."""
    for module in NEEDS.get(page, ()):
        pytest.importorskip(module)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)  # as for a script in that folder
    names = {"__name__": "__main__"}
    for title, code in blocks(page, "python"):
        if title:
            (tmp_path / title).write_text(code, "utf-8")
        else:
            exec(compile(code, page, "exec"), names)


def test_shortest_planner_drives_a_lap(tmp_path, monkeypatch, capsys):
    page = "docs/howto/own_planner.md"
    code = dict(blocks(page, "python"))["shortest.py"]
    assert len([line for line in code.splitlines() if line.strip()]) <= 20
    assert "--controller shortest.py:WidestView --laps 1" in (ROOT / page).read_text("utf-8")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "shortest.py").write_text(code, "utf-8")
    assert main(["race", "--controller", "shortest.py:WidestView", "--laps", "1"]) == 0, capsys.readouterr().out


def test_start_says_which_extras_make_installs():
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["optional-dependencies"]
    packages = {extra: {re.match(r"[\w-]+", each)[0] for each in texts} for extra, texts in extras.items()}
    lacking = {extra for extra, names in packages.items() if not names <= packages["dev"]}
    said = re.search(r"`make\s+test` installs all but ([^.]*)\.", (DOCS / "start.md").read_text("utf-8"))[1]
    assert set(re.findall(r"`(\w+)`", said)) == lacking


@pytest.mark.parametrize("page", ONLY_IMPORTED)
def test_what_a_page_imports_is_there(page):
    pytest.importorskip("PIL")
    trees = [ast.parse(code) for _, code in blocks(page, "python")]
    imports = [node for tree in trees for node in tree.body if isinstance(node, (ast.Import, ast.ImportFrom))]
    assert imports
    exec(compile(ast.Module(imports, []), page, "exec"), {})


def test_commands_of_pages_are_accepted(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for title, code in (block for page in PAGES for block in blocks(page, "python")):
        if title:  # a file that a command may name
            Path(title).write_text(code, "utf-8")
    shown = [
        (page, line)
        for page in PAGES
        for line in "".join(code for _, code in blocks(page, "sh")).replace("\\\n", " ").splitlines()
    ]
    makefile = (ROOT / "Makefile").read_text("utf-8")
    for page, line in shown:
        words = shlex.split(line, comments=True)
        command = words[0].rpartition("/")[2] if words else ""
        if command == "fg-mujoco":
            try:
                _parser().parse_args([word.replace("$TASK", "7") for word in words[1:]])
            except SystemExit:
                pytest.fail(f"{page}: {line}\n{capsys.readouterr().err}")
        elif command == "make":
            assert re.search(rf"^{words[1]}:", makefile, re.MULTILINE), f"{page}: {line}"
        elif words[0:2] == ["python", "-m"] and "fg_mujoco" in words[2]:
            assert find_spec(words[2]) is not None, f"{page}: {line}"
        elif command == "python" and words[1].endswith(".py"):
            assert (ROOT / words[1]).exists(), f"{page}: {line}"


def test_names_and_files_on_pages_are_there():
    """Of the tables that say where modules moved, the new names."""
    folders = "fg_mujoco|controllers|addons|models|tracks|tests|docs|benchmarks|examples"
    wrong = []
    for page in PAGES:
        text = without_old_names(page)
        dotted = set(re.findall(r"(?<![\w./-])fg_mujoco(?:\.[A-Za-z_]\w*)+", text)) - ENTRY_POINT_GROUPS
        wrong += [(page, name) for name in sorted(dotted) if not imported(name)]
        short = set(re.findall(r"(?<![\w./-])fg\.([A-Za-z_]\w*)", text))
        wrong += [(page, name) for name in sorted(short) if not hasattr(fg, name)]
        named = set(re.findall(rf"`((?:{folders})/[\w/.]*)`", text))
        wrong += [(page, name) for name in sorted(named) if "NAME" not in name and not (ROOT / name).exists()]
    assert wrong == []


def test_benchmarks_faults_are_of_texts_and_tests_that_there_are(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    faults = importlib.import_module("faults")
    checkout = Path(faults.__file__).resolve().parents[1]  # not the copy in which a fault is made
    tests = {path.name for path in (checkout / "tests").rglob("*")}
    for name, fault in faults.FAULTS.items():
        assert (checkout / fault.file).read_text("utf-8").count(fault.old) == 1, name
        assert tests.issuperset(fault.tests.split()), name


def test_tables_of_figures_are_those_of_the_file(tables):
    figures = json.loads((DOCS / "figures.json").read_text("utf-8"))
    marked = set()
    for page in tables.PAGES:
        text = (ROOT / page).read_text("utf-8")
        marked |= {name for _, name, _ in tables.MARKED.findall(text)}
        assert tables.filled(text, figures) == text, f"{page}: accepted: what `make figures` writes"
    assert marked == set(tables.TABLES)


def test_the_table_of_tires_is_what_the_lab_measures():
    shown = json.loads((DOCS / "figures.json").read_text("utf-8"))["sets"]
    assert list(shown) == list(tire_names())
    for name in ("f1tenth", "forzaeth_nuc5"):  # at .4 rad, the last
        (row,) = SETS.measure({"tires": name, "steering": 0.4}, LabSettings())
        found = [row[column] for column in ("slides_over_law", "leaves_arc_over_law", "curvature_at_law")]
        last = [float(cell.split(", ")[-1].replace("-", "nan")) for cell in shown[name].split("; ")[1:]]
        np.testing.assert_allclose(found, last, atol=0.01)


def test_links_of_pages_lead_somewhere(hooks):
    for page in PAGES:
        text = re.sub(r"^```.*?^```", "", (ROOT / page).read_text("utf-8"), flags=re.MULTILINE | re.DOTALL)
        for target in re.findall(r"\]\(([^)\s#]+)[^)]*\)", text):
            path = ((ROOT / page).parent / target).resolve()
            made = path.parent == DOCS / "planners" and path.stem in hooks.planner_names()
            assert "://" in target or path.exists() or made, f"{page}: {target}"


def test_every_page_is_in_the_navigation(hooks):
    listed = set(re.findall(r"^\s*- (?:.*: )?(\S+\.md)(?:  #.*)?$", CONFIG, re.MULTILINE))
    there = {path.relative_to(DOCS).as_posix() for path in READ}
    assert listed == there | set(hooks.PAGES_OF_THE_ROOT)
    nav = hooks.on_config({"nav": [{"Planners": ["planners.md"]}]})["nav"]
    assert nav == [{"Planners": ["planners.md", *(f"planners/{name}.md" for name in hooks.planner_names())]}]


def test_every_planner_has_a_page_with_its_diagram(hooks):
    assert set(hooks.planner_names()) == set(fg.controller_names())
    for name in fg.controller_names():
        page = hooks.planner_page(name)
        assert f"images/planners/{name}.png" in page
        assert "Limits" in page
        settings = fg.make_controller(
            name, car=fg.World("oval").parameters, mu=1.0, max_speed=8.0, map_line=fg.load_track("oval").map_line
        ).settings
        missing = [field for field in vars(settings) if f"| `{field}` |" not in page]
        assert not missing, missing


def test_every_public_name_is_on_one_page_of_the_api_with_an_example():
    """The examples are run with those of the other pages."""
    assert len(fg.__all__) <= 80
    shown, used = [], set()
    pages = [*DOCS.glob("api/*.md"), *DOCS.glob("addons/*/api.md")]
    for page in (path.relative_to(ROOT).as_posix() for path in pages):
        here = re.findall(r"^::: \S*\.(\w+)$", (ROOT / page).read_text("utf-8"), re.MULTILINE)
        if page == "docs/api/errors.md":  # all of fg_mujoco.errors is shown
            here += [name for name in fg.__all__ if name.endswith("Error")]
        shown += here
        code = "".join(code for _, code in blocks(page, "python"))
        used |= set(re.findall(r"\bfg\.(\w+)", code)) & set(here)
    public = set(fg.__all__) - {"__version__"}
    assert {name: shown.count(name) for name in public} == dict.fromkeys(public, 1)
    assert public - used == set()


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The folder of the site, whose signatures are left as they are: a process that formats one is started for each."""
    for module in ("mkdocs", "material", "mkdocstrings_handlers"):
        if find_spec(module) is None:
            pytest.skip(f"no {module}: pip install -e '.[docs]'")
    folder = tmp_path_factory.mktemp("docs") / "site"
    build = "import sys; sys.modules.update(black=None, ruff=None); from mkdocs.__main__ import cli; cli()"
    command = [sys.executable, "-c", build, "build", "--strict", "--site-dir", str(folder)]
    made = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert made.returncode == 0, made.stderr[-3000:]
    return folder


@pytest.mark.slow
def test_site_builds_without_a_warning_and_fetches_nothing(site):
    pages = list(site.rglob("*.html"))
    assert {"index.html", "gap_finder.html", "changelog.html", "races.html"} <= {page.name for page in pages}
    for page in pages:
        fetched = re.findall(r'<(?:script|link|img)\b[^>]*\b(?:src|href)="(https?:[^"]+)"', page.read_text("utf-8"))
        assert fetched == [], page
    races = next(page for page in pages if page.name == "races.html").read_text("utf-8")
    assert "from a standing start" in races  # the comment behind RaceResult.lap_times_s


@pytest.mark.slow
def test_search_of_the_site_works_from_the_disk_without_network(site, page_of):
    with page_of() as page:
        page.context.set_offline(True)
        page.goto((site / "howto" / "own_map.html").as_uri())
        page.locator("input[name=query]").click()
        page.keyboard.type("hairpins")
        results = page.locator(".md-search-result__link")
        results.first.wait_for(timeout=20_000)
        links = [link.get_attribute("href") for link in results.all()]
        assert any("/circuits.html" in link for link in links), links
        page.goto(links[0])
        assert page.locator("h1").is_visible()
