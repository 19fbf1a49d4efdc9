"""Record the picture at the head of the README: a drawing, its recognised parts, the live page.

    python docs/record_live.py

It runs the commands of the README in an empty folder: it exports the shipped XY stage as a drawing,
imports this drawing, serves the written file as a live page, and lets a browser drag the output and
move a slider. Needs chromium, chromedriver, selenium and the extra `flexfem[live]`.
"""

from __future__ import annotations

import io
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PIL import Image
from selenium import webdriver
from selenium.webdriver.common.action_chains import ActionChains

TARGET = Path(__file__).with_name("live.gif")
SIZE = (1400, 960)  # of the window, pixels
WIDTH = 960  # of the picture
PART = ("--thickness", "10mm", "--material", "al-7075-t6")
FIRST = 2500  # ms, of the drawing and of the answers by finite elements
MOVING = 120  # ms, of a frame in which something moves
THICKNESS = "parameters.neck_mm"  # of the leaves, in the imported file
WAIT = 240  # s, for finite elements
COLOURS = 64
Frame = tuple[Image.Image, int]


def run(folder: Path, *arguments: str) -> None:
    """Run a command of flexfem in a folder."""
    subprocess.run([sys.executable, "-m", "flexfem", *arguments], cwd=folder, check=True)


def browser() -> webdriver.Chrome:
    """Return a browser without a window."""
    options = webdriver.ChromeOptions()
    options.binary_location = str(shutil.which("chromium"))
    for switch in ("--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"):
        options.add_argument(switch)
    found = webdriver.Chrome(
        options=options, service=webdriver.ChromeService(str(shutil.which("chromedriver")))
    )
    found.set_window_size(*SIZE)
    return found


def shot(page: webdriver.Chrome, duration: int) -> Frame:
    """Return what the browser shows, and how long it is shown, ms."""
    image = Image.open(io.BytesIO(page.get_screenshot_as_png())).convert("RGB")
    return image.resize((WIDTH, round(image.height * WIDTH / image.width))), duration


def picture(path: Path, duration: int, size: tuple[int, int]) -> Frame:
    """Return a picture of a file on a white ground."""
    image = Image.open(path).convert("RGB")
    image.thumbnail(size)
    ground = Image.new("RGB", size, "white")
    ground.paste(image, ((size[0] - image.width) // 2, (size[1] - image.height) // 2))
    return ground, duration


def dragged(page: webdriver.Chrome) -> Iterator[Frame]:
    """Drag the output along a path and let it go."""
    output = page.find_element("css selector", ".handled .output")
    ActionChains(page).move_to_element(output).click_and_hold().perform()
    for angle in np.linspace(0.0, 1.5 * np.pi, 12):
        step = 14 * np.array([np.cos(angle), -np.sin(angle)])
        ActionChains(page, duration=20).move_by_offset(*step.round().astype(int).tolist()).perform()
        yield shot(page, MOVING)
    ActionChains(page).release().perform()
    page.find_element("xpath", "//button[text()='release']").click()


def slid(page: webdriver.Chrome) -> Iterator[Frame]:
    """Move the slider of the thickness of the leaves to other values."""
    number = page.find_element("css selector", f"#sliders input[data-path='{THICKNESS}']")
    value = float(number.get_attribute("value") or 0.0)
    for share in np.linspace(1.0, 1.35, 8)[1:]:
        page.execute_script(
            "arguments[0].value = arguments[1]; arguments[0].dispatchEvent(new Event('input'))",
            number,
            value * share,
        )
        time.sleep(0.6)
        assert not page.find_element("id", "fault").is_displayed(), "the page states a fault"
        yield shot(page, MOVING)


def answered(page: webdriver.Chrome) -> None:
    """Wait until finite elements have answered."""
    for _ in range(WAIT):
        if page.find_element("id", "elements").text.startswith("second values"):
            return
        time.sleep(1.0)
    raise SystemExit("finite elements have not answered in time")


def recorded(folder: Path) -> list[Frame]:
    """Return the frames."""
    run(folder, "new", "example.toml", "--kind", "xy-stage")
    run(folder, "export", "example.toml", "-o", "part.dxf")
    run(folder, "import", "part.dxf", "-o", "part.toml", *PART)
    run(folder, "view", "part.dxf", *PART, "-o", str(folder))
    drawing = next(folder.glob("part*.png"))
    server = subprocess.Popen(
        [sys.executable, "-m", "flexfem", "live", "part.toml", "--no-browser"],
        cwd=folder,
        stdout=subprocess.PIPE,
        text=True,
    )
    page = browser()
    try:
        assert server.stdout is not None
        address = re.match(r"\S+", server.stdout.readline())
        assert address is not None
        page.get(address[0])
        time.sleep(3.0)
        first = shot(page, MOVING)
        frames = [picture(drawing, FIRST, first[0].size), shot(page, FIRST // 2)]
        frames += dragged(page)
        frames += slid(page)
        answered(page)
        return [*frames, shot(page, FIRST)]
    finally:
        page.quit()
        server.terminate()
        server.wait()


def main() -> None:
    """Write the picture."""
    with tempfile.TemporaryDirectory() as folder:
        frames = recorded(Path(folder))
    images = [image.quantize(COLOURS) for image, _ in frames]
    images[0].save(
        TARGET,
        save_all=True,
        append_images=images[1:],
        duration=[duration for _, duration in frames],
        loop=0,
        optimize=True,
    )
    print(f"{TARGET}: {len(frames)} frames, {TARGET.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
