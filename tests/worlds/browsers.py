"""A real browser for the tests of pages, where there is one."""

import contextlib
import shutil

import pytest

_NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
_SWITCHES = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")


def _missing():
    try:
        import playwright.sync_api  # noqa: F401
    except ImportError:
        return "no playwright here: pip install -e '.[dev]'"
    with contextlib.suppress(Exception), open_page() as page:
        page.goto("about:blank")
        return ""
    return "no browser here: apt-get install -y --no-install-recommends chromium, or playwright install chromium"


@contextlib.contextmanager
def open_page(**settings):
    """Yield an empty page of a headless Chromium: one that is installed, or playwright's own."""
    from playwright.sync_api import sync_playwright

    found = next(filter(None, map(shutil.which, _NAMES)), None)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=found, args=list(_SWITCHES))
        try:
            yield browser.new_page(**settings)
        finally:
            browser.close()


WRITTEN = """
window.written = {};
const write = CanvasRenderingContext2D.prototype.fillText, wipe = CanvasRenderingContext2D.prototype.setTransform;
CanvasRenderingContext2D.prototype.setTransform = function (...settings) {
  window.written[this.canvas.id || this.canvas.ariaLabel] = [];
  return wipe.apply(this, settings);
};
CanvasRenderingContext2D.prototype.fillText = function (text, x, y) {
  const found = this.measureText(text), box = this.canvas.getBoundingClientRect();
  const texts = window.written[this.canvas.id || this.canvas.ariaLabel] ??= [];
  texts.push({ text, left: x - found.actualBoundingBoxLeft, right: x + found.actualBoundingBoxRight,
    top: y - found.actualBoundingBoxAscent, bottom: y + found.actualBoundingBoxDescent,
    width: box.width, height: box.height });
  return write.call(this, text, x, y);
};
"""
"""JavaScript that notes where a page writes texts on its canvases, by their ids, in `window.written`."""


def outside_or_over_another(texts):
    """Return the texts of a canvas, as WRITTEN notes them, that leave it or lie on another one."""
    wrong = []
    for each in texts:
        beyond = max(-each["left"], -each["top"], each["right"] - each["width"], each["bottom"] - each["height"])
        wrong += [each["text"]] if beyond > 1.0 else []
    for place, one in enumerate(texts):
        for two in texts[:place]:
            across = min(one["right"], two["right"]) - max(one["left"], two["left"])
            if across > 0 and min(one["bottom"], two["bottom"]) > max(one["top"], two["top"]):
                wrong.append(f"{two['text']} and {one['text']}")
    return wrong


@pytest.fixture(scope="session")
def page_of():
    """What opens a page, or a skip with its reason."""
    if reason := _missing():
        pytest.skip(reason)
    return open_page
