"""A real Chromium, driven over its DevTools pipe: one start for all tests of a module, no library needed."""

from __future__ import annotations

import base64
import json
import os
import shutil
import subprocess
import time
from pathlib import Path
from typing import Any

import pytest

SECONDS = 60.0
"""Longest that one answer may take."""


class Browser:
    """One tab.  What its console says and what it asks of a network is kept in `said` and `asked`."""

    def __init__(self, program: str, home: Path) -> None:
        into, self._commands = os.pipe()
        self._answers, out = os.pipe()
        # the browser reads commands from descriptor 3 and answers on 4
        shell = f'exec "$@" 3<&{into} 4>&{out}'
        options = [
            "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run",
            f"--user-data-dir={home}", "--remote-debugging-pipe", "--hide-scrollbars", "about:blank",
        ]  # fmt: skip
        self._process = subprocess.Popen(
            ["bash", "-c", shell, "bash", program, *options],
            pass_fds=(into, out), stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
        )  # fmt: skip
        os.close(into)
        os.close(out)
        self._number, self._rest = 0, b""
        self.said: list[str] = []
        self.asked: list[str] = []
        pages = self.send("Target.getTargets", session=None)["targetInfos"]
        target = next(page["targetId"] for page in pages if page["type"] == "page")
        attached = self.send("Target.attachToTarget", session=None, targetId=target, flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.send(f"{domain}.enable")

    def send(self, method: str, *, session: str | None = "", **parameters: Any) -> Any:
        """Carry a command out; returns its result."""
        self._number += 1
        message: dict[str, Any] = {"id": self._number, "method": method, "params": parameters}
        if session is not None:
            message["sessionId"] = self._session
        os.write(self._commands, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._next()
            if answer.get("id") == self._number:
                assert "error" not in answer, answer
                return answer["result"]

    def _next(self) -> dict[str, Any]:
        end = time.monotonic() + SECONDS
        while b"\0" not in self._rest:
            assert time.monotonic() < end, "the browser does not answer"
            got = os.read(self._answers, 1 << 20)
            assert got, "the browser has ended"
            self._rest += got
        one, _, self._rest = self._rest.partition(b"\0")
        found: dict[str, Any] = json.loads(one)
        kind, what = found.get("method"), found.get("params", {})
        if kind == "Runtime.consoleAPICalled":
            self.said.append(str([x.get("value") for x in what["args"]]))
        elif kind == "Runtime.exceptionThrown":
            self.said.append(str(what["exceptionDetails"]))
        elif kind == "Log.entryAdded":
            self.said.append(what["entry"]["text"])
        elif kind == "Network.requestWillBeSent":
            self.asked.append(what["request"]["url"])
        return found

    def open(self, path: Path, *, width: int = 1100, height: int = 900, dark: bool = False) -> None:
        """Load a page afresh; `said` and `asked` begin anew."""
        look = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
        self.send("Emulation.setEmulatedMedia", features=look)
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.send("Emulation.setDeviceMetricsOverride", **size)
        self.said, self.asked = [], []
        self.send("Page.navigate", url=path.as_uri())
        while self._next().get("method") != "Page.loadEventFired":
            pass
        # after the first drawing
        self.run("new Promise((f) => requestAnimationFrame(() => requestAnimationFrame(f)))")

    def run(self, script: str) -> Any:
        """The value of an expression in the page."""
        found = self.send("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in found, found
        return found["result"].get("value")

    def mouse(self, kind: str, x: float, y: float, **more: Any) -> None:
        """A mouse event at a point of the window [pixels]."""
        self.send("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)

    def picture(self, path: Path) -> None:
        """The whole page as PNG, to be looked at."""
        found = self.send("Page.captureScreenshot", captureBeyondViewport=True)
        path.write_bytes(base64.b64decode(found["data"]))

    def close(self) -> None:
        """End it."""
        self._process.terminate()
        self._process.wait(20)
        os.close(self._commands)
        os.close(self._answers)


def start(home: Path) -> Browser:
    """A browser; the test is skipped where there is none, unless tools are required here."""
    program = shutil.which("chromium") or shutil.which("chromium-browser")
    if program is None and not os.environ.get("SPRINGCHECK_REQUIRE_TOOLS"):
        pytest.skip("chromium is not here")
    assert program, "chromium is required here"
    return Browser(program, home)
