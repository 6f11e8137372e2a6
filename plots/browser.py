"""A page in headless Chromium, driven through its DevTools protocol over a pair of pipes: no port, no driver program.

    with Browser() as browser:
        page = browser.open(Path("report.html"))
        page.click("summary")
        print(page.value("document.title"))
"""
from __future__ import annotations

import base64
import json
import os
import select
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

from files import write_whole

kNames = ("chromium", "chromium-browser", "google-chrome")
kPatience = 60.0  # seconds that an answer may take, on a machine busy with other things


def chromium() -> str | None:
    """The browser's program, None where none is installed."""
    return next((found for found in map(shutil.which, kNames) if found), None)


class BrowserError(Exception):
    """What the browser or a page's script said was wrong."""


class Browser:
    """One running Chromium with a profile of its own that goes when it ends."""

    def __init__(self):
        program = chromium()
        if not program:
            raise BrowserError("no Chromium; apt-get install chromium")
        self._profile = tempfile.TemporaryDirectory(prefix="icbench-browser-", ignore_cleanup_errors=True)
        theirs_in, self._out = os.pipe()
        self._in, theirs_out = os.pipe()
        # The protocol is spoken on the file descriptors 3 and 4.
        command = ["bash", "-c", f'exec "$@" 3<&{theirs_in} 4>&{theirs_out}', "browser", program, "--headless",
                   "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run",
                   "--disable-background-networking", "--disable-component-update", "--disable-sync",
                   "--remote-debugging-pipe", f"--user-data-dir={self._profile.name}", "about:blank"]
        self._said = Path(self._profile.name) / "stderr.txt"
        with self._said.open("w") as said:
            self._process = subprocess.Popen(command, pass_fds=(theirs_in, theirs_out), stdin=subprocess.DEVNULL,
                                             stdout=subprocess.DEVNULL, stderr=said)
        os.close(theirs_in)
        os.close(theirs_out)
        self._buffer, self._number = b"", 0
        self.events: list[dict] = []

    def __enter__(self) -> "Browser":
        return self

    def __exit__(self, *_):
        try:
            self.ask("Browser.close")
        except (BrowserError, OSError):
            self._process.kill()
        self._process.wait()
        os.close(self._in)
        os.close(self._out)
        self._profile.cleanup()

    def _message(self, until: float) -> dict:
        while b"\0" not in self._buffer:
            ready = select.select([self._in], [], [], max(0.0, until - time.monotonic()))[0]
            data = os.read(self._in, 1 << 16) if ready else b""
            if not data:
                said = self._said.read_text(errors="replace").splitlines()[-5:]
                about = "ended" if ready else f"does not answer for {kPatience:g} s"
                raise BrowserError("\n".join([f"the browser {about}; its last words:", *said]))
            self._buffer += data
        message, _, self._buffer = self._buffer.partition(b"\0")
        return json.loads(message)

    def ask(self, method: str, session: str | None = None, **parameters) -> dict:
        """The protocol's answer to one request."""
        self._number += 1
        request = {"id": self._number, "method": method, "params": parameters}
        if session:
            request["sessionId"] = session
        os.write(self._out, json.dumps(request).encode() + b"\0")
        until = time.monotonic() + kPatience
        while (message := self._message(until)).get("id") != self._number:
            self.events.append(message)
        if "error" in message:
            raise BrowserError(f"{method}: {message['error'].get('message')}")
        return message["result"]

    def wait_for(self, method: str, session: str, **parameters) -> dict:
        """The next event of that name with these parameters, or one that came already."""
        until = time.monotonic() + kPatience
        while True:
            for message in self.events:
                if (message.get("method") == method and message.get("sessionId") == session
                        and parameters.items() <= message["params"].items()):
                    self.events.remove(message)
                    return message["params"]
            self.events.append(self._message(until))

    def open(self, path: Path, width: int = 1280, height: int = 900) -> "Page":
        """A new page that has loaded a file."""
        target = self.ask("Target.createTarget", url="about:blank")["targetId"]
        session = self.ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Network", "Log", "Performance"):
            self.ask(f"{domain}.enable", session)
        self.ask("Page.setLifecycleEventsEnabled", session, enabled=True)
        page = Page(self, session, target)
        page.resize(width, height)
        page.go_to(path)
        return page


class Page:
    def __init__(self, browser: Browser, session: str, target: str):
        self._browser, self._session, self._target = browser, session, target

    def ask(self, method: str, **parameters) -> dict:
        return self._browser.ask(method, self._session, **parameters)

    def close(self) -> None:
        self._browser.ask("Target.closeTarget", targetId=self._target)

    def go_to(self, path: Path) -> None:
        """Loads a file. The blank page before it has a load event too: the loader's name tells them apart."""
        loader = self.ask("Page.navigate", url=path.resolve().as_uri())["loaderId"]
        self._browser.wait_for("Page.lifecycleEvent", self._session, name="load", loaderId=loader)

    def resize(self, width: int, height: int) -> None:
        self.ask("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def value(self, expression: str):
        """What an expression of JavaScript gives; promises are waited for. Raises BrowserError where it throws."""
        got = self.ask("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in got:
            about = got["exceptionDetails"]
            raise BrowserError(about.get("exception", {}).get("description") or about["text"])
        return got["result"].get("value")

    def until(self, expression: str):
        """What an expression gives in the first frame in which it is true; null after half of `kPatience`."""
        return self.value(f"""new Promise((done) => {{
            const end = performance.now() + {1e3 * kPatience / 2};
            const look = () => {{
                const found = ({expression});
                if (found || performance.now() > end) done(found || null);
                else requestAnimationFrame(look);
            }};
            look();
        }})""")

    def processor_time(self) -> float:
        """Seconds of processor time of the page's process so far."""
        found = self.ask("Performance.getMetrics")["metrics"]
        return next(metric["value"] for metric in found if metric["name"] == "ProcessTime")

    def _place(self, selector: str) -> tuple[float, float]:
        """The middle of an element, scrolled into view and at rest: charts find their size within some frames."""
        place = self.value(f"""new Promise((done) => {{
            let before = null;
            const look = () => {{
                const found = document.querySelector({json.dumps(selector)});
                if (!found) return done(null);
                found.scrollIntoView({{block: "center", behavior: "instant"}});
                const {{x, y, width, height}} = found.getBoundingClientRect();
                const now = [x + width / 2, y + height / 2, width * height];
                if (String(now) === before) return done(now);
                before = String(now);
                requestAnimationFrame(look);
            }};
            look();
        }})""")
        if not place or not place[2]:
            raise BrowserError(f"no visible {selector}")
        return place[0], place[1]

    def _mouse(self, kind: str, x: float, y: float, **more) -> None:
        self.ask("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)

    def click(self, selector: str) -> None:
        """A real click, in the middle of the first element that fits."""
        x, y = self._place(selector)
        self._mouse("mouseMoved", x, y)
        for kind in ("mousePressed", "mouseReleased"):
            self._mouse(kind, x, y, button="left", clickCount=1)

    def hover(self, selector: str, dx: float = 0.0, dy: float = 0.0) -> None:
        """The pointer `dx`, `dy` pixels off the middle of an element."""
        x, y = self._place(selector)
        self._mouse("mouseMoved", x + dx, y + dy)

    def press(self, key: str, code: int) -> None:
        """A key, by its name and its Windows key code."""
        for kind in ("keyDown", "keyUp"):
            self.ask("Input.dispatchKeyEvent", type=kind, key=key, code=key, windowsVirtualKeyCode=code)

    def type_over(self, selector: str, words: str) -> None:
        """Replaces what stands in an input, as a person would."""
        self.click(selector)
        self.value(f"document.querySelector({json.dumps(selector)}).select()")
        if words:
            self.ask("Input.insertText", text=words)
        else:
            self.press("Delete", 46)

    def complaints(self) -> list[str]:
        """Errors and warnings of the page since the last call, and every request but that for the page itself."""
        found, kept = [], []
        for event in self._browser.events:
            parameters = event.get("params", {})
            if event.get("sessionId") != self._session:
                kept.append(event)
            elif event["method"] == "Runtime.exceptionThrown":
                about = parameters["exceptionDetails"]
                found.append(about.get("exception", {}).get("description") or about["text"])
            elif event["method"] == "Log.entryAdded" and parameters["entry"]["level"] in ("error", "warning"):
                found.append(parameters["entry"]["text"])
            elif event["method"] == "Runtime.consoleAPICalled" and parameters["type"] in ("error", "warning"):
                found.append(str(parameters["args"]))
            elif event["method"] == "Network.requestWillBeSent":
                address = parameters["request"]["url"]
                if parameters.get("type") != "Document" and not address.startswith("data:"):
                    found.append(f"asked for {address}")
        self._browser.events = kept
        return found

    def picture(self, path: Path, whole: bool = False) -> None:
        """A PNG of the window, or of all of the page."""
        more = {"captureBeyondViewport": True, "clip": self._whole()} if whole else {}
        write_whole(path, base64.b64decode(self.ask("Page.captureScreenshot", format="png", **more)["data"]))

    def _whole(self) -> dict:
        size = self.ask("Page.getLayoutMetrics")["cssContentSize"]
        return {"x": 0, "y": 0, "width": size["width"], "height": size["height"], "scale": 1}

    def printed(self, path: Path) -> None:
        """A PDF of the page on A4."""
        made = self.ask("Page.printToPDF", printBackground=True, preferCSSPageSize=True)
        write_whole(path, base64.b64decode(made["data"]))
