"""The kit of all pages: what is text stays text, one table in three formats, and a page that loads nothing."""

import csv
import io
import re

import numpy as np
import pytest

from fg_mujoco.display import Html, element, html
from fg_mujoco.errors import RunFolderError
from fg_mujoco.pictures.pages.page import boxes, names_and_values, note, result, switch, write_page
from fg_mujoco.pictures.pages.table import Table

MARKUP = "<b a='1'>&\"</b>"


def test_what_is_no_html_is_escaped_wherever_it_stands():
    parts = [
        element("td", MARKUP, title=MARKUP), html("<p>{text}</p>", text=[MARKUP, None, 1.5]), note(MARKUP),
        result(MARKUP, True, MARKUP), boxes([(MARKUP, MARKUP)]), switch("way", [(MARKUP, MARKUP)]),
        names_and_values([(MARKUP, MARKUP)]), Table(header=(MARKUP,), rows=[(MARKUP,)], legend=MARKUP).html(),
        Table(header=(MARKUP,), rows=[(MARKUP,)], legend=MARKUP).notebook(),
    ]  # fmt: skip
    for part in parts:
        assert isinstance(part, Html) and "<b a" not in part
        assert "&lt;b a=&#x27;1&#x27;&gt;&amp;&quot;&lt;/b&gt;" in part


def test_a_table_is_the_same_in_three_formats():
    table = Table(header=("name", "x [m]", "good"), rows=[("a|b", 1.23456, True), ("c", None, False)], left=("name",))
    assert [*csv.reader(io.StringIO(table.csv()))] == [
        ["name", "x [m]", "good"], ["a|b", "1.23456", "True"], ["c", "", "False"]
    ]  # fmt: skip
    assert table.markdown() == (
        "| name | x [m] | good |\n| ---- | ----: | ---: |\n| a\\|b | 1.235 |  yes |\n| c    |     - |   no |\n"
    )
    cells = [re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row) for row in table.html().split("<tr>")[1:]]
    assert cells == [["name", "x [m]", "good"], ["a|b", "1.235", "yes"], ["c", "-", "no"]]
    assert table.html().count('class="left"') == 3


def test_a_table_of_records_has_all_their_columns_in_order_and_its_legend_below():
    table = Table.of([{"b": 1, "a": 2}, {"c": np.float64(3.0), "b": 4}])
    assert (list(table.header), list(table.rows)) == (["b", "a", "c"], [[1, 2, None], [4, None, 3.0]])
    assert Table.of([], ["a"]).csv() == "a\n"
    assert Table(header=("a",), rows=[("1",)], legend="Why.").markdown().endswith("|\n\nWhy.\n")
    assert 'class="here" data-time="2.500"' in Table(header=("a",), rows=[("1",)], times=[2.5]).html()


def test_a_page_stands_alone_and_no_data_ends_its_script(tmp_path):
    data = {"x": "</script>{y}"}
    path = write_page(tmp_path / "page.html", MARKUP, note("a"), script="go();\r\n", data=data, style="p { top: 0 }")
    text = path.read_text("utf-8")
    assert "http://" not in text and "https://" not in text and "<b a" not in text
    assert text.count("</script>") == 3 and "\\u003c/script>{y}" in text  # the data, page.js, and its own
    assert text.count("'sha256-") == 2 and "prefers-color-scheme: dark" in text and "p { top: 0 }" in text
    assert "script-src 'none'" in write_page(tmp_path / "plain.html", "a", note("b")).read_text("utf-8")


def test_a_page_that_cannot_be_written_is_refused_in_one_line(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(RunFolderError, match=r"page\.html: cannot be written: .*; accepted: a file in a folder"):
        write_page(tmp_path / "file" / "page.html", "a", note("b"))
