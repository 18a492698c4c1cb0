"""The pages of reports: whole, self-contained, refused where they cannot be; in a browser, cursor and switches."""

import functools
import importlib.util
import json
import re
import shutil

import pytest

import fg_mujoco as fg
from browsers import opened
from cases import each
from fg_mujoco.cli.main import main
from fg_mujoco.errors import MissingExtraError, RunFolderError, install_command
from fg_mujoco.racing import run_folder
from pages import MARKUP, Page
from refusals import refused

pytest.importorskip("bokeh", reason="no bokeh here: pip install -e '.[report]'")

from fg_mujoco.addons.look.report import write_report
from fg_mujoco.addons.look.report.recorded import read_recorded

_SCALES = """(() => {
    const find = (view) => view.model.name === "map" ? view : Array.from(view.child_views || []).map(find).find(v => v);
    const frame = Bokeh.index.roots.map(find).find(v => v).frame;
    const scale = (s) => Math.abs(s.compute(1) - s.compute(0));
    return [scale(frame.x_scale), scale(frame.y_scale)];
})()"""


@pytest.fixture(scope="module")
def folder(lap, tmp_path_factory):
    """A run folder of one lap."""
    return fg.write_run(lap, tmp_path_factory.mktemp("runs") / "oval", picture=False)


@pytest.fixture(scope="module")
def report(folder):
    """Its report, without a clip."""
    return write_report(folder, folder / "report.html", clip_seconds=None)


def test_page_says_how_the_race_went_runs_its_own_scripts_by_hash_and_loads_nothing(report, lap):
    text = report.read_text("utf-8")
    page = Page(text)
    assert page.loads == [] and page.policy.startswith("default-src 'none'; script-src 'sha256-")
    assert not re.search(r"@import|url\(\s*['\"]?https?:", text[: text.index("<script>")])
    assert len(page.scripts) == 4 and page.runs_its_own_scripts_alone()
    assert "oval, gap_finder" in text and lap.trajectory_sha256 in text
    assert f"1 of 1 laps, best {lap.car.lap_times_s[0]:.3f} s; no tire slid." in text
    assert f"<td>mu</td><td><code>{lap.car.mu}</code></td>" in text
    assert "<h2>The last decision</h2>" in text and "proposal: reference" in text and "meets nothing" in text


@each("begins, at", [(0.0, "0.000"), (0.09, "0.100")])
def test_page_says_that_the_planner_did_not_answer(begins, at, here, monkeypatch):
    monkeypatch.setattr("fg_mujoco.pictures.plots.trace_picture", None)  # the page is what is looked at
    (here / "planner.py").write_text("from fg_mujoco.messages import STOP\nclass P:\n    def reset(self): pass\n"
                                     "    def __call__(self, scan, odometry):\n"
                                     f"        while scan.stamp >= {begins}: pass\n        return STOP\n")  # fmt: skip
    assert main(["race", "--controller", "planner.py:P", "--decision-limit", "0.2", "--out", "run", "--force"]) == 1
    assert f"Decision limit: no command within 0.2 s at t = {at} s." in (here / "run" / "report.html").read_text()


def test_report_of_a_result_and_of_its_folder_show_the_same(report, lap, tmp_path):
    other = write_report(lap, tmp_path / "other.html", clip_seconds=None).read_text()
    body = re.compile(r"<h1>.*?<div class=\"switch\"", re.DOTALL)
    assert body.search(other).group() == body.search(report.read_text()).group()


def test_without_bokeh_the_race_is_written_all_the_same(here, monkeypatch, capsys):
    real = importlib.util.find_spec
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None if name == "bokeh" else real(name))
    assert main(["race", "--laps", "1", "--time-limit", "0.2", "--out", "run"]) == 1
    assert f"report.html is left out; report pages need Bokeh: {install_command('report')}" in capsys.readouterr().err
    assert not (here / "run" / "report.html").exists()
    said = f"fg-mujoco: report pages need Bokeh: {install_command('report')}\n"
    assert refused(here, capsys, "report", "run") == said


def test_clip_that_cannot_be_drawn_is_told_in_the_page(folder, tmp_path, monkeypatch):
    def refuse(*args, **settings):
        raise MissingExtraError("apt-get install something")

    monkeypatch.setattr("fg_mujoco.pictures.rendering.Film", refuse)
    text = write_report(folder, tmp_path / "page.html", clip_seconds=1.0).read_text()
    assert "<video" not in text
    assert "<code>apt-get install something</code>" in text


def test_cursor_of_one_plot_is_that_of_all_and_nothing_is_asked_of_the_network(report, lap, page_of):
    with opened(page_of, report) as page:
        page.wait_for_timeout(500)
        across, up = page.evaluate(_SCALES)
        assert across == pytest.approx(up, rel=0.01)  # a metre is a metre, either way
        page.locator(".plots").nth(1).hover(position={"x": 600, "y": 110})
        page.wait_for_selector("#readout[data-tick]")
        tick = int(page.get_attribute("#readout", "data-tick"))
        said = page.inner_text("#readout").replace("\n", " ")
        row = dict(zip(fg.TELEMETRY, lap.car.telemetry[tick], strict=True))
        assert f"t {row['time_s']:.3f} s" in said
        assert f"speed {row['speed_m_s']:.2f} m/s" in said
        marked = page.evaluate(
            "Array.from(Bokeh.documents[0]._all_models.values()).find(m => m.name === 'cursor_source').data"
        )
        assert marked["x_m"][0] == pytest.approx(row["x_m"], abs=1e-4)
        assert marked["y_m"][0] == pytest.approx(row["y_m"], abs=1e-4)

        page.click("[data-switch=across][value=time_s]")
        page.click("[data-switch=colour][value=friction_utilisation]")
        assert page.get_attribute("#map", "data-colour") == "friction_utilisation"
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


_LEGENDS = """(() => {
    const found = [];
    const look = (view) => {
        if (view.model.name === "legend") found.push([view.bbox.left, view.bbox.right, view.parent.bbox.width, view.model.items.map((i) => i.label.value)]);
        for (const child of view.child_views || []) look(child);
        for (const child of (view.renderer_views ? view.renderer_views.values() : [])) look(child);
    };
    for (const root of Bokeh.index.roots) look(root);
    return found;
})()"""  # noqa: E501


def test_page_fits_the_screen_and_no_legend_is_cut(report, page_of):
    with opened(page_of, report, 390, 900) as page:
        for width in (390, 1280):
            page.set_viewport_size({"width": width, "height": 900})
            page.wait_for_timeout(500)
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            legends = page.evaluate(_LEGENDS)
            assert len(legends) == 4
            for left, right, room, names in legends:
                assert 0.0 <= left < right <= room, names


def leaves(value, path=()):
    """Yield the path of every string and number in a summary."""
    if isinstance(value, dict):
        for key, part in value.items():
            yield from leaves(part, (*path, key))
    elif isinstance(value, list):
        for place, part in enumerate(value):
            yield from leaves(part, (*path, place))
    else:
        yield path


def with_markup(value, path):
    """Return a summary with markup in the place of one value."""
    if not path:
        return MARKUP
    copy = dict(value) if isinstance(value, dict) else list(value)
    copy[path[0]] = with_markup(copy[path[0]], path[1:])
    return copy


def test_no_value_of_a_summary_becomes_markup(folder, tmp_path, capsys, monkeypatch):
    """Each is in the page as text, or is refused by its name; the telemetry stays what it is and is read once."""
    monkeypatch.setattr(run_folder, "_read_telemetry", functools.cache(run_folder._read_telemetry))
    summary = json.loads((folder / "summary.json").read_text())
    copy = tmp_path / "run"
    shutil.copytree(folder, copy, ignore=shutil.ignore_patterns("report.html"))
    taken, count = summary, 0
    for path in leaves(summary):
        if path == ("schema",):
            continue
        (copy / "summary.json").write_text(json.dumps(with_markup(summary, path)))
        try:
            read_recorded(copy)
            taken = with_markup(taken, path)
        except RunFolderError:
            line = refused(tmp_path, capsys, "report", str(copy), "--no-clip")
            assert f"summary.json: {path[0]} is " in line
            count += 1
    refusals = 45 + len(summary["files"]) + 2 * len(summary["last_decision"])
    assert (taken["controller"], taken["track"], taken["vehicle"], count) == (MARKUP, MARKUP, MARKUP, refusals)
    (copy / "summary.json").write_text(json.dumps(taken))
    assert main(["report", str(copy), "--no-clip"]) == 0
    text = (copy / "report.html").read_text("utf-8")
    assert "<script>alert" not in text and "<img" not in text and Page(text).runs_its_own_scripts_alone()
    assert text.count("&lt;script&gt;alert(1)") >= sum(path != ("schema",) for path in leaves(summary)) - count
