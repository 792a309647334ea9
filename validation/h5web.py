"""H5Web, in a browser, draws every store at once: the default plot, every observable, every table, positions.

    python validation/h5web.py [folder for screenshots]

Stores are made by the command line and opened by double click in JupyterLab, whose extension jupyterlab-h5web
carries H5Web, with h5grove behind it.  Needs, beside springcheck: `pip install jupyterlab
'jupyterlab-h5web[full]' selenium`, and Chromium with its driver (Debian: chromium, chromium-driver).

Shown means: a figure with a title whose canvas is not blank, or a grid whose cells, in exact notation, are
the numbers that h5py reads.  Exit status 1 and the paths, where something is not shown.

Expected, in about six minutes: "0 are not shown".  Seen with jupyterlab-h5web
12.9.0 (H5Web 18.0.0), h5grove 4.0.0 and Chromium 156.
"""

from __future__ import annotations

import io
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from matplotlib.image import imread

from arguments import arguments, script
from springcheck.errors import SpringcheckError

STORES = {
    "spring": ("run", "spring"),
    "spring-uneven": ("run", "spring-uneven", "--method", "own:euler"),
    "chain": ("run", "chain", "--method", "openmm:verlet"),
    "pendulum": ("run", "pendulum", "--method", "own:euler"),
    "precision": ("precision", "spring", "--budget", "5"),
    "stability": ("stability", "overdamped", "--method", "own:*euler"),
    "resonance": ("stability", "multiple-time-steps", "--method", "openmm:mts"),
    "extremes": ("extremes", "--quick", "--method", "own:euler"),
}
BROWSER = (
    "--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--window-size=2400,1200", "--no-first-run", "--disable-quic", "--disable-sync",
    "--disable-background-networking", "--disable-component-update",
)  # fmt: skip
CSS, XPATH = "css selector", "xpath"
"""How WebDriver is told where an element is."""
PATIENCE = 10.0
"""Time after which something counts as not shown [s]."""
COLOURED = 30
"""Pixels of a colour from which a canvas counts as drawn: axes and grid are grey."""


class Viewer:
    """H5Web with one file open."""

    def __init__(self, driver: Any, address: str, name: str) -> None:
        from selenium.common.exceptions import WebDriverException
        from selenium.webdriver import ActionChains
        from selenium.webdriver.support.ui import WebDriverWait

        again = (WebDriverException,)
        self.driver = driver
        self.wait = WebDriverWait(driver, PATIENCE, poll_frequency=0.1, ignored_exceptions=again)
        driver.get(f"{address}/lab/workspaces/{name}")
        entry = f"//li[contains(@class,'jp-DirListing-item')][.//span[text()='{name}.h5']]"

        def opened(d: Any) -> bool:
            if not d.find_elements(CSS, '[role=treeitem][data-path="/"]'):
                ActionChains(d).double_click(d.find_element(XPATH, entry)).perform()
                return False
            return True

        WebDriverWait(driver, 6 * PATIENCE, poll_frequency=3, ignored_exceptions=again).until(opened)

    def title(self) -> str:
        """The title of the figure that is shown, once something is drawn in it."""
        self.wait.until(lambda d: _coloured(d.find_element(CSS, "figure canvas")) >= COLOURED)
        shown = "figure[aria-label]"
        return str(self.wait.until(lambda d: d.find_element(CSS, shown).get_attribute("aria-label")))

    def select(self, path: str) -> None:
        """Click through the tree to a path, from a place where nothing is shown."""
        self._click("/h5md")
        self.wait.until(lambda d: not d.find_elements(CSS, "figure, [role=gridcell]"))
        steps = path.strip("/").split("/")
        for i in range(1, len(steps)):
            above = "/" + "/".join(steps[:i])
            if self._item(above).get_attribute("aria-expanded") == "false":
                self._click(above)
        self._click(path)

    def cells(self) -> list[str]:
        """The texts of the grid that is shown, numbers in exact notation."""
        self._press("Matrix")
        self._press("Exact")
        grid = "[role=gridcell]"
        texts = self.wait.until(lambda d: [cell.text for cell in d.find_elements(CSS, grid)])
        return [str(text) for text in texts]

    def _press(self, text: str) -> None:
        found = self.wait.until(lambda d: d.find_element(XPATH, f"//button[normalize-space()='{text}']"))
        self.driver.execute_script("arguments[0].click()", found)

    def _item(self, path: str) -> Any:
        return self.wait.until(lambda d: d.find_element(CSS, f'[role=treeitem][data-path="{path}"]'))

    def _click(self, path: str) -> None:
        self.driver.execute_script("arguments[0].click()", self._item(path))


def _coloured(canvas: Any) -> int:
    pixels = imread(io.BytesIO(canvas.screenshot_as_png))[..., :3]
    return int(np.sum(np.ptp(pixels, axis=-1) > 0.2))


def look(viewer: Viewer, path: Path, pictures: Path | None) -> tuple[int, list[str]]:
    """Look at everything in a store -> how much was looked at, and what is not shown."""
    from selenium.common.exceptions import WebDriverException

    asked: list[tuple[str, Any]] = [("", None)]
    with h5py.File(path) as file:
        file.visititems(lambda name, node: asked.extend(_asked(f"/{name}", node)))
    missing = []
    for where, first in asked:
        try:
            if where:
                viewer.select(where)
            found = viewer.title() if first is None else viewer.cells()[: len(first)]
            if first is not None and found != first and list(map(float, found)) != first:
                raise ValueError(f"{found} instead of {first}")
            print(
                f"  {where or 'on opening'}: {found if first is None else f'{len(first)} cells'}", flush=True
            )
        except (WebDriverException, ValueError) as error:
            missing.append(f"{path.name}:{where}: {type(error).__name__} {error}".strip())
            print(f"  {where or 'on opening'}: NOT SHOWN", flush=True)
        if pictures is not None:
            name = f"{path.stem}{where}".replace("/", "_")
            viewer.driver.save_screenshot(str(pictures / f"{name}.png"))
    return len(asked), missing


def _asked(where: str, node: Any) -> list[tuple[str, Any]]:
    """A path, and the first cells of its grid; None for a picture."""
    if isinstance(node, h5py.Group):
        return [(where, None)] if "signal" in node.attrs else []
    if where.startswith("/particles/") and node.ndim == 3:
        return [(where, node[0].ravel()[:12].tolist())]
    if h5py.check_string_dtype(node.dtype) and node.ndim == 1:
        return [(where, node.asstr()[:4].tolist())]
    return []


def main() -> int:
    """Make the stores, serve them, look at them."""
    pictures = arguments(__doc__, folder=Path).folder
    programs = {name: shutil.which(name) or "" for name in ("chromium", "chromedriver")}
    absent = [name for name in ("jupyterlab_h5web", "selenium") if not find_spec(name)]
    absent += [name for name, path in programs.items() if not path]
    if absent:
        raise SpringcheckError(f"this needs {', '.join(absent)}: see --help")
    from selenium import webdriver

    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    address = f"http://127.0.0.1:{port}"
    options = webdriver.ChromeOptions()
    options.binary_location = programs["chromium"]
    with tempfile.TemporaryDirectory() as kept, tempfile.TemporaryDirectory() as home:
        for argument in (*BROWSER, f"--user-data-dir={home}/chromium"):
            options.add_argument(argument)
        for name, command in STORES.items():
            made = [sys.executable, "-m", "springcheck", *command, "--quiet", "-o", f"{kept}/{name}.h5"]
            subprocess.run(made, check=True)
        lab = subprocess.Popen(
            [sys.executable, "-m", "jupyterlab", "--no-browser", "--allow-root", "--ip=127.0.0.1",
             f"--port={port}", "--IdentityProvider.token=", f"--ServerApp.root_dir={kept}"],
            env={**os.environ, "HOME": home}, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        try:
            _await(f"{address}/api")
            driver = webdriver.Chrome(
                options=options, service=webdriver.ChromeService(programs["chromedriver"])
            )
            try:
                looked, missing = 0, list[str]()
                for name in STORES:
                    print(f"{name}.h5", flush=True)
                    count, lost = look(Viewer(driver, address, name), Path(kept, f"{name}.h5"), pictures)
                    looked, missing = looked + count, missing + lost
            finally:
                driver.quit()
        finally:
            lab.terminate()
            lab.wait()
    print("\n".join([f"{looked} looked at in {len(STORES)} stores, {len(missing)} are not shown", *missing]))
    return 1 if missing else 0


def _await(address: str) -> None:
    for _ in range(300):
        try:
            urllib.request.urlopen(address, timeout=5).close()
            return
        except OSError:
            time.sleep(0.2)
    raise SpringcheckError(f"no answer from {address}")


if __name__ == "__main__":
    script(main)
