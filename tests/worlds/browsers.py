"""A real browser for the tests of pages, where there is one."""

import contextlib
import functools
import shutil
import subprocess
import time

import pytest

_NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
_SWITCHES = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist",
             "--hide-scrollbars", "--no-first-run", "--disable-background-networking")  # fmt: skip


@contextlib.contextmanager
def _chromium(folder):
    """Run a headless Chromium, one that is installed or playwright's own; yield where it listens."""
    from playwright.sync_api import sync_playwright

    found = next(filter(None, map(shutil.which, _NAMES)), None)
    if found is None:
        with sync_playwright() as playwright:
            found = playwright.chromium.executable_path
    command = [found, "--headless", *_SWITCHES, "--remote-debugging-port=0", f"--user-data-dir={folder}"]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as process:
        try:
            until, port = time.monotonic() + 30.0, folder / "DevToolsActivePort"
            while not port.exists() or "\n" not in port.read_text():
                if process.poll() is not None or time.monotonic() > until:
                    raise OSError("Chromium does not start")
                time.sleep(0.05)
            yield f"http://127.0.0.1:{port.read_text().split()[0]}"
        finally:
            process.terminate()


@contextlib.contextmanager
def _page_at(url, **settings):
    """Yield an empty page of the Chromium at an address."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        context = playwright.chromium.connect_over_cdp(url).new_context(**settings)
        try:
            yield context.new_page()
        finally:
            context.close()


@pytest.fixture(scope="session")
def page_of(tmp_path_factory):
    """What opens a page in the one Chromium of the session, or a skip with its reason."""
    pytest.importorskip("playwright.sync_api", reason="no playwright here: pip install -e '.[dev]'")
    try:
        with _chromium(tmp_path_factory.mktemp("chromium")) as url:
            yield functools.partial(_page_at, url)
    except OSError:
        pytest.skip("no browser here: apt-get install -y chromium, or playwright install chromium")


@contextlib.contextmanager
def opened(page_of, path, width=1280, height=1100):
    """Open a page from the disk, and yield it when it is ready: without errors, dialogs or other requests."""
    asked, errors = [], []
    with page_of(viewport={"width": width, "height": height}) as page:
        page.on("request", lambda request: asked.append(request.url))
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.on("dialog", lambda dialog: (errors.append(dialog.message), dialog.dismiss()))
        page.goto(path.as_uri())
        page.wait_for_selector("html[data-ready=yes]")
        yield page
    assert asked == [path.as_uri()] and errors == []
