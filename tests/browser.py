"""A headless Chromium behind its DevTools pipe: its log, its requests, and the values of scripts."""

import base64
import json
import os
import select
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
_PATIENCE = 60.0  # seconds for one answer


@dataclass
class Page:
    process: subprocess.Popen[bytes]
    into: int
    out: int
    complaints: list[str] = field(default_factory=list)
    """Messages that the page logged, and uncaught exceptions."""
    requests: list[str] = field(default_factory=list)
    """Addresses that it asked for, but for data: and its own."""
    _session: str = ""
    _count: int = 0
    _rest: bytes = b""

    def open(self, path: Path, fragment: str = "") -> None:
        target = self._ask("Target.createTarget", {"url": "about:blank"})["targetId"]
        attached = self._ask("Target.attachToTarget", {"targetId": target, "flatten": True})
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self._ask(f"{domain}.enable", {})
        self._ask("Page.navigate", {"url": path.resolve().as_uri() + fragment})
        self.wait_for("document.readyState === 'complete' && location.protocol === 'file:'")

    def ask(self, script: str) -> Any:
        """The value of a script's expression, awaited."""
        wanted = {"expression": script, "returnByValue": True, "awaitPromise": True}
        answer = self._ask("Runtime.evaluate", wanted)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def wait_for(self, script: str) -> None:
        """Ask until the expression is true."""
        until = time.monotonic() + _PATIENCE
        while not self.ask(script):
            assert time.monotonic() < until, f"{script} is not true after {_PATIENCE} s"
            time.sleep(0.05)

    def picture(self, width: int, height: int) -> bytes:
        """A screenshot, PNG."""
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self._ask("Emulation.setDeviceMetricsOverride", size)
        time.sleep(0.3)
        return base64.b64decode(self._ask("Page.captureScreenshot", {"format": "png"})["data"])

    def _ask(self, method: str, parameters: dict[str, Any]) -> dict[str, Any]:
        self._count += 1
        message: dict[str, Any] = {"id": self._count, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self.into, json.dumps(message).encode() + b"\0")
        while (answer := self._next()).get("id") != self._count:
            self._note(answer)
        assert "error" not in answer, answer["error"]
        result: dict[str, Any] = answer["result"]
        return result

    def _next(self) -> dict[str, Any]:
        while b"\0" not in self._rest:
            assert select.select([self.out], [], [], _PATIENCE)[0], "the browser does not answer"
            part = os.read(self.out, 1 << 16)
            assert part, "the browser is gone"
            self._rest += part
        head, _, self._rest = self._rest.partition(b"\0")
        message: dict[str, Any] = json.loads(head)
        return message

    def _note(self, event: dict[str, Any]) -> None:
        method, found = event.get("method"), event.get("params", {})
        if method == "Runtime.exceptionThrown":
            self.complaints.append(json.dumps(found["exceptionDetails"])[:500])
        elif method == "Runtime.consoleAPICalled":
            self.complaints.append(json.dumps(found["args"])[:500])
        elif method == "Log.entryAdded":
            self.complaints.append(found["entry"]["text"])
        elif method == "Network.requestWillBeSent":
            address = found["request"]["url"]
            if not address.startswith("data:") and found.get("type") != "Document":
                self.requests.append(address)


@contextmanager
def chromium(profile: Path) -> Iterator[Page]:
    """A browser without a network, with a profile folder of its own, ended at the end."""
    assert CHROMIUM is not None
    (theirs_in, into), (out, theirs_out) = os.pipe(), os.pipe()

    def hand_over() -> None:
        """DevTools reads from 3 and writes to 4."""
        high_in, high_out = os.dup(theirs_in), os.dup(theirs_out)
        os.dup2(high_in, 3, inheritable=True)
        os.dup2(high_out, 4, inheritable=True)

    command = [
        CHROMIUM, "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run",
        "--disable-background-networking", "--host-resolver-rules=MAP * ~NOTFOUND", "--remote-debugging-pipe",
        "--window-size=1280,900", f"--user-data-dir={profile}",
    ]  # fmt: skip
    quiet = subprocess.DEVNULL
    process = subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet, close_fds=False, preexec_fn=hand_over)
    os.close(theirs_in)
    os.close(theirs_out)
    try:
        yield Page(process, into, out)
    finally:
        process.terminate()
        process.wait(30)
        os.close(into)
        os.close(out)
