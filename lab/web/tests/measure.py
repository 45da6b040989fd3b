"""Times of the page of ``tsa-lab report`` in headless Chromium, as a JSON object: ``measure.py FILE.html``."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

from test_page import OPTIONS

# Mean of many states over the range of the default scene.
SOLVES = """() => {
  const begun = performance.now();
  for (let k = 0; k < 4000; k += 1) tsa.solve(1 + k % 17, (k * 7 % 75) / 10);
  return (performance.now() - begun) / 4000 * 1e3;
}"""

# What each redraw takes while keys turn the motor and change the load.
FRAMES = """async () => {
  const drawing = document.getElementById("drawing");
  const keys = ["ArrowRight", "ArrowDown", "ArrowRight", "ArrowUp", "ArrowLeft"];
  const taken = [];
  for (let k = 0; k < 200; k += 1) {
    drawing.dispatchEvent(new KeyboardEvent("keydown", { key: keys[k % keys.length], cancelable: true }));
    for (let n = 0; n < 2; n += 1) await new Promise(requestAnimationFrame);
    taken.push(tsa.frame_ms);
  }
  return taken.sort((a, b) => a - b);
}"""


def main(file: str) -> None:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=os.environ.get("TSA_CHROMIUM"), args=OPTIONS)
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.goto(Path(file).resolve().as_uri())
        load_ms = page.evaluate("performance.getEntriesByType('navigation')[0].loadEventEnd")
        page.wait_for_function("tsa.state.map_done")
        map_ms = page.evaluate("performance.now()")
        solve_us = page.evaluate(SOLVES)
        frames = page.evaluate(FRAMES)
        print(json.dumps({
            "kilobytes": Path(file).stat().st_size * 1e-3,
            "chromium": browser.version,
            "load_ms": load_ms,
            "map_ms": map_ms,
            "solve_us": solve_us,
            "frame_ms": frames[len(frames) // 2],
            "frame_ms_95": frames[len(frames) * 95 // 100],
        }))
        browser.close()


if __name__ == "__main__":
    main(sys.argv[1])
