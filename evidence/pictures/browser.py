"""Chromium without a window, driven over a pipe by the DevTools protocol: opens a page, tells its errors and times,
evaluates expressions and takes pictures."""

from __future__ import annotations

import base64
import json
import os
import select
import subprocess
import time
from pathlib import Path
from typing import Any

FLAGS = (
    "--headless", "--no-sandbox", "--disable-background-networking", "--hide-scrollbars", "--use-gl=angle",
    "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--remote-debugging-pipe",
)  # fmt: skip


class Browser:
    """A browser with one page. Use as a context manager; `profile` is an empty folder of its own."""

    def __init__(self, profile: Path, width: int = 1280, height: int = 900):
        self.errors: list[str] = []
        self._number, self._rest = 0, b""
        out, self._write = os.pipe()
        self._read, back = os.pipe()
        command = ["chromium", *FLAGS, f"--user-data-dir={profile}", f"--window-size={width},{height}", "about:blank"]
        wired = ["bash", "-c", f'exec 3<&{out} 4>&{back}; exec "$@"', "bash", *command]
        quiet = subprocess.DEVNULL
        self._process = subprocess.Popen(wired, pass_fds=(out, back), stdout=quiet, stderr=quiet)
        os.close(out)
        os.close(back)
        page = next(t for t in self._call("Target.getTargets")["targetInfos"] if t["type"] == "page")
        self._session = self._call("Target.attachToTarget", targetId=page["targetId"], flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self.call(f"{domain}.enable")
        mobile = width < 600  # CSS pixels: a telephone's window
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=mobile)
        self.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": "light"}])

    def __enter__(self) -> Browser:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.terminate()
        self._process.wait(timeout=20)
        os.close(self._write)
        os.close(self._read)

    def open(self, path: Path, limit: float = 60) -> None:
        """Open a report and wait until all that is in the window is drawn."""
        self.call("Page.navigate", url=path.resolve().as_uri())
        self.wait("ready", limit)

    def wait(self, state: str, limit: float = 60) -> None:
        """Wait until the report is `ready` (all that is in the window is drawn) or `complete` (every figure that comes
        near the window is drawn at once), or has failed."""
        end = time.monotonic() + limit
        while not self.value(f"!!document.querySelector('html.{state},html.failed')"):
            assert time.monotonic() < end, f"the page does not get {state}"
            time.sleep(0.02)

    def draw_all(self, limit: float = 60) -> None:
        """Have every figure drawn, those below the window too."""
        self.wait("complete", limit)
        self.value("window.dispatchEvent(new Event('beforeprint'))")
        end = time.monotonic() + limit
        while self.value("document.querySelectorAll('.plot').length > gearfmuPage.drawn") and time.monotonic() < end:
            time.sleep(0.05)

    def value(self, expression: str) -> Any:
        """What an expression gives, as JSON."""
        found = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    def picture(self, path: Path, clip: tuple[float, float, float, float] | None = None) -> None:
        """A PNG of the window, or of a clip x, y, width, height of the page."""
        how: dict[str, Any] = {"captureBeyondViewport": clip is not None}
        if clip is not None:
            how["clip"] = dict(zip(("x", "y", "width", "height"), clip, strict=True)) | {"scale": 1}
        path.write_bytes(base64.b64decode(self.call("Page.captureScreenshot", **how)["data"]))

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """A command of the protocol to the page."""
        return self._call(method, self._session, **parameters)

    def _call(self, method: str, session: str | None = None, **parameters: Any) -> dict[str, Any]:
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        message |= {"sessionId": session} if session else {}
        os.write(self._write, json.dumps(message).encode() + b"\0")
        while True:
            found = self._next()
            if found.get("id") == self._number:
                assert "error" not in found, found
                return dict(found["result"])
            self._note(found)

    def _note(self, event: dict[str, Any]) -> None:
        known = event.get("params", {})
        if event.get("method") == "Runtime.exceptionThrown":
            self.errors.append(str(known["exceptionDetails"]))
        elif event.get("method") == "Runtime.consoleAPICalled" and known["type"] in ("error", "warning"):
            self.errors.append(str(known["args"]))
        elif event.get("method") == "Log.entryAdded" and known["entry"]["level"] in ("error", "warning"):
            self.errors.append(str(known["entry"]))

    def _next(self) -> dict[str, Any]:
        while b"\0" not in self._rest:
            assert select.select([self._read], [], [], 90)[0], "the browser does not answer"
            found = os.read(self._read, 1 << 20)
            assert found, "the browser has ended"
            self._rest += found
        line, self._rest = self._rest.split(b"\0", 1)
        return dict(json.loads(line))
