"""A tab of Chromium that notes whatever goes wrong in it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

CHROMIUM = next(
    filter(Path.exists, map(Path, ("/usr/bin/chromium", "/usr/bin/chromium-browser"))),
    None,
)

needs_chromium = pytest.mark.skipif(
    CHROMIUM is None, reason="needs chromium (apt install chromium)"
)


@contextmanager
def chromium() -> Iterator[Any]:
    """A browser without a window; the test is skipped where there is no Playwright."""
    sync = pytest.importorskip("playwright.sync_api")
    with sync.sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=str(CHROMIUM), args=["--no-sandbox", "--disable-gpu"]
        )
        yield browser
        browser.close()


def new_tab(browser: Any, width: int, scheme: str, wrong: list[str]) -> Any:
    """A tab whose errors are added to a list.

    Args:
        browser: see `chromium`.
        width: of the page, in pixels; it is 800 pixels high.
        scheme: "light" or "dark".
        wrong: receives errors of scripts, errors on the console, and the addresses of
            requests that failed.
    """
    tab = browser.new_page(
        viewport={"width": width, "height": 800}, color_scheme=scheme
    )
    tab.on("pageerror", lambda error: wrong.append(str(error)))

    def note_message(said: Any) -> None:
        if said.type in ("error", "warning"):
            wrong.append(said.text)

    def note_failure(request: Any) -> None:
        if "ERR_ABORTED" not in request.failure:  # by going to the next page
            wrong.append(request.url)

    tab.on("console", note_message)
    tab.on("requestfailed", note_failure)
    return tab
