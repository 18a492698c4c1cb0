"""The pages of reports: whole, self-contained, refused where they cannot be; in a browser, cursor and switches."""

import json
import re
import shutil
from html.parser import HTMLParser

import pytest
from browsers import page_of  # noqa: F401 - a fixture

import fg_mujoco as fg
from fg_mujoco.cli.main import main
from fg_mujoco.errors import MissingExtraError, RunFolderError
from fg_mujoco.racing.run_folder import summary_json

pytest.importorskip("bokeh", reason="no bokeh here: pip install 'fg-mujoco[report]'")

from fg_mujoco.studies.comparison.pages import write_comparison_report
from fg_mujoco.viz.report import write_report

_SCALES = """(() => {
    const find = (view) => view.model.name === "map" ? view : Array.from(view.child_views || []).map(find).find(v => v);
    const frame = Bokeh.index.roots.map(find).find(v => v).frame;
    const scale = (s) => Math.abs(s.compute(1) - s.compute(0));
    return [scale(frame.x_scale), scale(frame.y_scale)];
})()"""


class Loads(HTMLParser):
    """What a page loads, or links to; scripts' and styles' own text is not looked at."""

    def __init__(self):
        super().__init__()
        self.found, self.policy = [], ""

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        self.found += [values[name] for name in ("src", "href", "srcset", "data", "poster") if values.get(name)]
        if values.get("http-equiv") == "Content-Security-Policy":
            self.policy = values["content"]


@pytest.fixture(scope="module")
def folder(lap, tmp_path_factory):
    """A run folder of one lap."""
    return fg.write_run(lap, tmp_path_factory.mktemp("runs") / "oval", picture=False)


@pytest.fixture(scope="module")
def report(folder):
    """Its report, without a clip."""
    return write_report(folder, folder / "report.html", clip_seconds=None)


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def complaint(capsys):
    """What the command line said, which must be one line."""
    (line,) = capsys.readouterr().err.splitlines()
    return line


def test_page_loads_nothing_from_anywhere(report):
    text = report.read_text()
    loads = Loads()
    loads.feed(text)
    assert loads.found == []
    assert loads.policy.startswith("default-src 'none'; script-src 'unsafe-inline';")
    assert not re.search(r"@import|url\(\s*['\"]?https?:", text[: text.index("<script>")])


def test_page_says_how_the_race_went(report, lap):
    text = report.read_text()
    assert "oval, gap_finder" in text
    assert f"1 of 1 laps, best {lap.lap_times_s[0]:.3f} s; no tire slid." in text
    assert lap.trajectory_sha256 in text
    for name, value in (
        ("mu", lap.mu),
        ("seed", 0),
        ("mujoco_version", json.loads(summary_json(lap))["mujoco_version"]),
    ):
        assert f"<td>{name}</td><td><code>{value}</code></td>" in text


def test_report_of_a_result_and_of_its_folder_show_the_same(report, lap, tmp_path):
    other = write_report(lap, tmp_path / "other.html", clip_seconds=None).read_text()
    body = re.compile(r"<h1>.*?<div class=\"switch\"", re.DOTALL)
    assert body.search(other).group() == body.search(report.read_text()).group()


def test_names_are_text_and_never_markup(short_race, tmp_path):
    folder = fg.write_run(short_race, tmp_path / "run", picture=False)
    summary = json.loads((folder / "summary.json").read_text())
    (folder / "summary.json").write_text(json.dumps(summary | {"controller": "</script><img src=x>"}))
    text = write_report(folder, tmp_path / "page.html", clip_seconds=None).read_text()
    assert "<img" not in text
    assert "&lt;/script&gt;&lt;img src=x&gt;" in text


def test_race_of_no_lap_and_one_tick_have_reports(tmp_path):
    for limit in (0.02, 0.3):
        race = fg.race("oval", laps=1, time_limit=limit)
        assert "0 of 1 laps" in write_report(race, tmp_path / "page.html", clip_seconds=None).read_text()


@pytest.mark.parametrize("name", ["summary.json", "scene.xml", "states.npz", "telemetry.csv"])
def test_folder_without_one_of_its_files_is_refused(folder, name, tmp_path, capsys):
    copy = tmp_path / "run"
    shutil.copytree(folder, copy)
    (copy / name).unlink()
    assert main(["report", str(copy)]) == 2
    assert name in complaint(capsys)
    assert not [path for path in copy.iterdir() if "report" in path.name and path.name != "report.html"]


@pytest.mark.parametrize(
    ("change", "said"),
    [({"schema": 99}, "schema"), ({"mu": None}, "has no mu"), ({"lap_times_s": None}, "lap_times_s")],
)
def test_folder_of_another_version_is_refused(folder, change, said, tmp_path, capsys):
    copy = tmp_path / "run"
    shutil.copytree(folder, copy)
    (copy / "summary.json").write_text(json.dumps(json.loads((copy / "summary.json").read_text()) | change))
    assert main(["report", str(copy)]) == 2
    assert said in complaint(capsys)


def test_damaged_scene_is_refused(folder, tmp_path):
    copy = tmp_path / "run"
    shutil.copytree(folder, copy)
    (copy / "scene.xml").write_text("<mujoco/>")
    with pytest.raises(RunFolderError, match=r"scene\.xml"):
        write_report(copy, tmp_path / "page.html")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nowhere"], "summary.json"),
        (["{run}", "--clip", "0"], "--clip"),
        (["{run}", "--out", "page.txt"], ".html"),
        (["{run}", "--out", "no/such/folder/page.html", "--no-clip"], "cannot be written"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(folder, arguments, said, here, capsys):
    assert main(["report", *(text.format(run=folder) for text in arguments)]) == 2
    assert said in complaint(capsys)
    assert list(here.iterdir()) == []


def test_without_bokeh_the_race_is_written_all_the_same(here, monkeypatch, capsys):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert main(["race", "--laps", "1", "--time-limit", "0.2", "--out", "run"]) == 1
    assert (
        "report.html needs bokeh and is left out; to have it: pip install 'fg-mujoco[report]'"
        in capsys.readouterr().err
    )
    assert not (here / "run" / "report.html").exists()
    assert main(["report", "run"]) == 2
    assert complaint(capsys) == "fg-mujoco: pip install 'fg-mujoco[report]'"


def test_race_leaves_a_report_in_its_folder(here, capsys):
    assert main(["race", "--laps", "1", "--time-limit", "0.2", "--out", "run"]) == 1
    text = (here / "run" / "report.html").read_text()
    assert "0 of 1 laps" in text
    assert "<video" not in text


def test_clip_that_cannot_be_drawn_is_told_in_the_page(folder, tmp_path, monkeypatch):
    def refuse(*args, **settings):
        raise MissingExtraError("apt-get install something")

    monkeypatch.setattr("fg_mujoco.viz.rendering.Film", refuse)
    text = write_report(folder, tmp_path / "page.html", clip_seconds=1.0).read_text()
    assert "<video" not in text
    assert "<code>apt-get install something</code>" in text


def test_failure_leaves_no_page(folder, tmp_path, monkeypatch):
    (tmp_path / "page.html").mkdir()
    with pytest.raises(RunFolderError, match="cannot be written"):
        write_report(folder, tmp_path / "page.html", clip_seconds=None)
    assert [path.name for path in tmp_path.iterdir()] == ["page.html"]


@pytest.fixture(scope="module")
def comparison(tmp_path_factory):
    """Of two planners, one of them in a file, on a scene."""
    place = tmp_path_factory.mktemp("comparison")
    planner = place / "slow.py"
    planner.write_text(
        "from fg_mujoco.messages import DriveCommand\n"
        "class Slow:\n"
        "    def reset(self): pass\n"
        "    def __call__(self, scan, odometry): return DriveCommand(steering_angle=0.0, speed=1.0)\n"
    )
    fg.compare(
        ["gap_finder", f"{planner}:Slow"], scenes=["narrow_gap_150"], seeds=[0, 1], out=place / "out", workers=1,
        time_limit=3.0, pictures=False,
    )  # fmt: skip
    return place


def test_comparison_has_a_page_for_each_run_and_an_index(comparison, monkeypatch):
    monkeypatch.chdir(comparison)
    index = write_comparison_report("out")
    loads = Loads()
    loads.feed(index.read_text())
    pages = sorted(path.name for path in index.parent.glob("*.html") if path != index)
    assert sorted(loads.found) == pages
    assert len(pages) == 4
    for name in pages:
        text = (index.parent / name).read_text()
        page = Loads()
        page.feed(text)
        assert sorted(page.found) == ["bokeh.min.js", "index.html"]
        assert "the same run, bit for bit" in text
    before = {path: path.stat().st_mtime_ns for path in index.parent.glob("*-*.html")}
    write_comparison_report("out")  # goes on where it was: nothing is left to do
    assert {path: path.stat().st_mtime_ns for path in index.parent.glob("*-*.html")} == before


def test_planner_that_is_not_here_any_more_leaves_a_remark(comparison, here):
    shutil.copytree(comparison / "out", here / "out", ignore=shutil.ignore_patterns("report"))
    text = write_comparison_report(here / "out").read_text()
    assert text.count("slow.py:Slow: is not in this folder as it was") == 2
    assert len(list((here / "out" / "report").glob("*-*.html"))) == 2


@pytest.mark.parametrize(
    "manifest",
    ["{", "[]", '{"schema": 99, "settings": {"laps": 1}, "versions": {}}', '{"settings": {}, "versions": {}}'],
)
def test_comparison_of_another_version_is_refused(manifest, here, capsys):
    (here / "out").mkdir()
    (here / "out" / "manifest.json").write_text(manifest)
    assert main(["report", "out"]) == 2
    assert "manifest.json" in complaint(capsys)


def test_cursor_of_one_plot_is_that_of_all_and_nothing_is_asked_of_the_network(report, lap, page_of):  # noqa: F811
    asked = []
    with page_of(viewport={"width": 1280, "height": 1000}) as page:
        page.on("request", lambda request: asked.append(request.url))
        page.goto(report.as_uri())
        page.wait_for_selector("html[data-ready=yes]")
        page.wait_for_timeout(500)
        across, up = page.evaluate(_SCALES)
        assert across == pytest.approx(up, rel=0.01)  # a metre is a metre, either way
        page.locator(".plots").nth(1).hover(position={"x": 600, "y": 110})
        page.wait_for_selector("#readout[data-tick]")
        tick = int(page.get_attribute("#readout", "data-tick"))
        said = page.inner_text("#readout").replace("\n", " ")
        row = dict(zip(fg.TELEMETRY, lap.telemetry[tick], strict=True))
        assert f"t {row['time_s']:.3f} s" in said
        assert f"speed {row['speed_m_s']:.2f} m/s" in said
        marked = page.evaluate(
            "Array.from(Bokeh.documents[0]._all_models.values()).find(m => m.name === 'cursor_source').data"
        )
        assert marked["x_m"][0] == pytest.approx(row["x_m"], abs=1e-4)
        assert marked["y_m"][0] == pytest.approx(row["y_m"], abs=1e-4)

        page.click("[data-switch=across][value=time_s]")
        page.click("[data-switch=colour][value=friction_use]")
        assert page.get_attribute("#map", "data-colour") == "friction_use"
        page.locator(".plots").nth(1).hover(position={"x": 500, "y": 110})
        page.wait_for_timeout(300)
        assert int(page.get_attribute("#readout", "data-tick")) != tick
        page.locator("#map").hover(position={"x": 400, "y": 120})
        page.wait_for_timeout(300)
        assert (
            page.evaluate(
                "Array.from(Bokeh.documents[0]._all_models.values()).find(m => m.name === 'axis_across').axis_label"
            )
            == "time [s]"
        )
    assert asked == [report.as_uri()]
