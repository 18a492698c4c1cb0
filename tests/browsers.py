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


@pytest.fixture(scope="session")
def page_of():
    """What opens a page, or a skip with its reason."""
    if reason := _missing():
        pytest.skip(reason)
    return open_page
