"""Check a world's report in headless Chromium: its size, load time, console errors and network requests."""

from __future__ import annotations

import argparse
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from benchmarks.results import run_benchmark
from pipeline.errors import InputError
from pipeline.worlds import DEFAULT, world_folder

_BROWSERS = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome")
_SOFTWARE_GL = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]
_PHONE = 390
_MOST_MB = 5


@dataclass(frozen=True)
class PageCheck:
    """A page in a browser.

    `colours` counts the colours of the 3-D view from above, `lit_colours` those with the headlamp; `phone_px` is the
    page's width on a phone.
    """

    load_s: float
    console_errors: list[str]
    requests: list[str]
    colours: int
    lit_colours: int
    phone_px: int


def find_browser() -> str | None:
    """Return the path of Chromium, or None if it is not installed."""
    return next((path for name in _BROWSERS if (path := shutil.which(name))), None)


def look_at(page_file: Path, browser: str, pictures: Path) -> PageCheck:
    """Open a page from its file, check it at the widths of a desktop and a phone, and save screenshots."""
    from playwright.sync_api import sync_playwright

    pictures.mkdir(parents=True, exist_ok=True)
    console_errors: list[str] = []
    requests: list[str] = []
    with sync_playwright() as run:
        chromium = run.chromium.launch(executable_path=browser, args=_SOFTWARE_GL)
        page = chromium.new_page(viewport={"width": 1200, "height": 900})
        page.on("console", lambda m: console_errors.append(m.text) if m.type == "error" else None)
        page.on("pageerror", lambda e: console_errors.append(str(e)))
        page.on(
            "request", lambda r: requests.append(r.url) if not r.url.startswith(("file:", "data:", "blob:")) else None
        )
        page.goto(page_file.resolve().as_uri())
        load_ms = page.evaluate("performance.getEntriesByType('navigation')[0].loadEventEnd")
        page.screenshot(path=str(pictures / "report.png"))
        scene = page.locator("iframe.scene")
        scene.scroll_into_view_if_needed()
        page.frame_locator("iframe.scene").locator("canvas").wait_for(timeout=30_000)
        page.wait_for_timeout(1500)
        scene.screenshot(path=str(pictures / "scene.png"))
        page.frame_locator("iframe.scene").locator("#headlamp").click()
        page.wait_for_timeout(1500)
        scene.screenshot(path=str(pictures / "headlamp.png"))
        page.set_viewport_size({"width": _PHONE, "height": 800})
        phone_px = page.evaluate("document.documentElement.scrollWidth")
        page.screenshot(path=str(pictures / "phone.png"))
        chromium.close()
    above, lit = (_colours(pictures / name) for name in ("scene.png", "headlamp.png"))
    return PageCheck(load_ms / 1000, console_errors, requests, above, lit, int(phone_px))


def _colours(picture: Path) -> int:
    """Return the number of colours in a picture, 0 if there is none."""
    pixels = cv2.imread(str(picture))
    return len(np.unique(pixels.reshape(-1, 3), axis=0)) if pixels is not None else 0


def main() -> int:
    """Print the results; exit code 2 if the page is too large, too slow or has errors."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.pictures.look_at_report", description=__doc__)
    parser.add_argument("name", nargs="?", default="default")
    arguments = parser.parse_args()
    page = world_folder(arguments.name) / "report" / "report.html"
    browser = find_browser()
    if browser is None:
        raise InputError(f"no Chromium found ({', '.join(_BROWSERS)}); Debian has chromium-headless-shell")
    check = look_at(page, browser, Path("artifacts/bench/report"))
    if arguments.name == DEFAULT:
        shutil.copyfile("artifacts/bench/report/report.png", "docs/report.png")
    size_mb = page.stat().st_size / 1e6
    print(f"size              {size_mb:.1f} MB (at most {_MOST_MB})")
    print(f"load              {check.load_s:.2f} s (at most 2)")
    print(f"console errors    {len(check.console_errors)} {check.console_errors[:3]}")
    print(f"network requests  {len(check.requests)}")
    print(f"3-D view          {check.colours} colours, {check.lit_colours} with the headlamp")
    print(f"width on a phone  {check.phone_px} px of {_PHONE}")
    drawn = min(check.colours, check.lit_colours) > 16
    faultless = not check.console_errors and not check.requests and drawn and check.phone_px <= _PHONE
    return 0 if faultless and size_mb <= _MOST_MB and check.load_s <= 2 else 2


if __name__ == "__main__":
    sys.exit(run_benchmark("look", main))
