"""Real browsers without a network, for tests of pages."""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import sys
import time
from base64 import b64decode
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

BROWSER = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
"""Path of Chromium, or None."""
FIREFOX = next(filter(None, map(shutil.which, ("firefox-esr", "firefox"))), None)
"""Path of Firefox, or None."""
_PREFERENCES = {
    "marionette.port": 0, "network.proxy.type": 1, "network.proxy.http": "127.0.0.1",
    "network.proxy.http_port": 9, "network.proxy.ssl": "127.0.0.1", "network.proxy.ssl_port": 9,
}
_HELPERS = (
    "const sleep = (ms) => new Promise((done) => setTimeout(done, ms));"
    "const frame = () => new Promise((done) =>"
    " requestAnimationFrame(() => requestAnimationFrame(done)));"
)
_OPTIONS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
    "--host-resolver-rules=MAP * ~NOTFOUND", "--proxy-server=127.0.0.1:9",
)
_EXEC = """
import fcntl, os, sys
ends = [fcntl.fcntl(int(end), fcntl.F_DUPFD, 10) for end in sys.argv[1:3]]
for end, place in zip(ends, (3, 4)):
    os.dup2(end, place)
os.execv(sys.argv[3], sys.argv[3:])
"""
"""Moves the ends of the pipes to where Chromium looks for them."""
_KEYS = {" ": (32, "Space", " "), "Enter": (13, "Enter", "\r"),
         "Home": (36, "Home", ""), "End": (35, "End", ""),
         "PageUp": (33, "PageUp", ""), "PageDown": (34, "PageDown", ""),
         "ArrowLeft": (37, "ArrowLeft", ""), "ArrowUp": (38, "ArrowUp", ""),
         "ArrowRight": (39, "ArrowRight", ""), "ArrowDown": (40, "ArrowDown", "")}
"""Number, code and text of keys."""


def browse(place: Path, *options: str) -> tuple[str, str]:
    """What a browser without a network prints, and what it complains of."""
    assert BROWSER is not None
    done = subprocess.run(
        [
            BROWSER, *_OPTIONS, "--allow-file-access-from-files", "--enable-logging=stderr",
            f"--user-data-dir={place / 'profile'}", *options,
        ],
        cwd=place, capture_output=True, text=True, timeout=600, check=True,
    )
    complaints = "\n".join(line for line in done.stderr.splitlines() if "CONSOLE" in line)
    return done.stdout, complaints


def dumped(place: Path, page: Path, *options: str) -> tuple[str, str]:
    """A page as it is after its scripts, and what the browser complains of."""
    return browse(place, *options, "--virtual-time-budget=20000", "--dump-dom", page.as_uri())


class Driver:
    """A page in a browser of its own."""

    complaints: list[str]

    def navigate(self, address: str) -> None:
        """Go to an address."""
        raise NotImplementedError

    def run(self, script: str) -> Any:
        """What a script returns, the body of an asynchronous function.

        ``await frame()`` waits for the next picture, ``await sleep(ms)`` for a time.
        """
        raise NotImplementedError

    def close(self) -> None:
        """End the browser."""
        raise NotImplementedError

    def open(self, page: Path, link: str = "") -> None:
        """Show a page, and wait until it is ready: its body has that class.

        Parameters
        ----------
        link
            What follows ``#`` in the address.
        """
        self.navigate(page.as_uri() + (f"#{link}" if link else ""))
        ready = self.run(
            "const ready = () => document.body?.classList.contains('ready');"
            "for (let i = 0; i < 15000 && !ready(); i++) await sleep(20);"
            "await frame(); return ready()"
        )
        assert ready, f"the page is not ready: {self.complaints}"


class Tab(Driver):
    """A page in Chromium, driven as people do, over its debugging pipe.

    Attributes
    ----------
    complaints
        What the browser complains of: errors of scripts, refusals of the content security policy.
    asked
        Addresses that the page asked for, itself included.
    """

    def __init__(self, folder: Path, width: int = 1400, height: int = 1000, *, dark: bool = False,
                 touch: bool = False) -> None:
        assert BROWSER is not None
        (theirs, self._out), (self._in, answers) = os.pipe(), os.pipe()
        self._process = subprocess.Popen(
            [sys.executable, "-c", _EXEC, str(theirs), str(answers), BROWSER, *_OPTIONS,
             "--remote-debugging-pipe", f"--user-data-dir={mkdtemp(dir=folder)}", "about:blank"],
            pass_fds=(theirs, answers), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )
        os.close(theirs)
        os.close(answers)
        self._rest, self._count, self._session = b"", 0, ""
        self.complaints: list[str] = []
        self.asked: list[str] = []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        attached = self.call("Target.attachToTarget", targetId=target, flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height,
                  deviceScaleFactor=1, mobile=touch)
        self.call("Emulation.setTouchEmulationEnabled", enabled=touch)
        self.dark(dark)

    def close(self) -> None:
        """End the browser."""
        self._process.kill()
        self._process.wait()
        os.close(self._in)
        os.close(self._out)

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """The answer to a command of the DevTools protocol."""
        self._count += 1
        asked = {"id": self._count, "method": method, "params": parameters}
        told = asked | ({"sessionId": self._session} if self._session else {})
        os.write(self._out, json.dumps(told).encode() + b"\0")
        while True:
            answer = self._next()
            if answer.get("id") == self._count:
                assert "error" not in answer, answer
                return dict(answer["result"])
            self._note(answer)

    def _next(self) -> dict[str, Any]:
        while b"\0" not in self._rest:
            some = os.read(self._in, 1 << 20)
            assert some, "the browser has ended"
            self._rest += some
        message, _, self._rest = self._rest.partition(b"\0")
        return dict(json.loads(message))

    def _note(self, event: dict[str, Any]) -> None:
        """Keep what an event complains of, or asks for."""
        told = event.get("params", {})
        match event.get("method"):
            case "Runtime.exceptionThrown":
                self.complaints.append(json.dumps(told["exceptionDetails"]))
            case "Runtime.consoleAPICalled" if told["type"] in ("error", "warning", "assert"):
                self.complaints.append(json.dumps(told["args"]))
            case "Log.entryAdded" if told["entry"]["level"] in ("error", "warning"):
                self.complaints.append(told["entry"]["text"])
            case "Network.requestWillBeSent":
                self.asked.append(told["request"]["url"])

    def navigate(self, address: str) -> None:
        """Go to an address."""
        self.call("Page.navigate", url=address)

    def run(self, script: str) -> Any:
        """See `Driver.run`."""
        told = self.call("Runtime.evaluate", awaitPromise=True, returnByValue=True,
                         expression=f"(async () => {{ {_HELPERS} {script} }})()")
        assert "exceptionDetails" not in told, told["exceptionDetails"]
        return told["result"].get("value")

    def key(self, name: str) -> None:
        """Press a key."""
        number, code, text = _KEYS[name]
        told = {"key": name, "code": code, "windowsVirtualKeyCode": number}
        self.call("Input.dispatchKeyEvent", type="keyDown", text=text, **told)
        self.call("Input.dispatchKeyEvent", type="keyUp", **told)

    def drag(self, *points: tuple[float, float]) -> None:
        """Press the mouse at the first point of the window, and move it over the others."""
        for i, (x, y) in enumerate(points):
            self._mouse("mouseMoved" if i else "mousePressed", x, y)
        self._mouse("mouseReleased", *points[-1])

    def _mouse(self, kind: str, x: float, y: float) -> None:
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left",
                  buttons=int(kind != "mouseReleased"), clickCount=1)

    def touch(self, *points: tuple[float, float]) -> None:
        """Put a finger on the first point of the window, and move it over the others."""
        for i, (x, y) in enumerate(points):
            self.call("Input.dispatchTouchEvent", type="touchMove" if i else "touchStart",
                      touchPoints=[{"x": x, "y": y}])
        self.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])

    def dark(self, dark: bool) -> None:
        """Say which colours the reader prefers."""
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])

    def picture(self, file: Path) -> None:
        """Save what is shown as PNG."""
        told = self.call("Page.captureScreenshot", format="png")
        file.write_bytes(b64decode(told["data"]))


class Fox(Driver):
    """A page in Firefox, over its remote protocol: messages in JSON, each after its length."""

    def __init__(self, folder: Path) -> None:
        assert FIREFOX is not None
        self.complaints = []
        profile = Path(mkdtemp(dir=folder))
        (profile / "user.js").write_text("".join(
            f"user_pref({json.dumps(name)}, {json.dumps(it)});" for name, it in _PREFERENCES.items()
        ))
        self._process = subprocess.Popen(
            [FIREFOX, "--headless", "--marionette", "--no-remote", "--profile", str(profile)],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )
        self._socket, self._rest, self._count = self._connected(profile), b"", 0
        self._next()  # a greeting
        self.call("NewSession", capabilities={})
        self.call("SetTimeouts", script=600_000)

    def _connected(self, profile: Path) -> socket.socket:
        told = profile / "MarionetteActivePort"
        while not (told.exists() and told.read_text()):
            assert self._process.poll() is None, "the browser has ended"
            time.sleep(0.05)
        return socket.create_connection(("127.0.0.1", int(told.read_text())))

    def close(self) -> None:
        """End the browser."""
        self._socket.close()
        self._process.kill()
        self._process.wait()

    def call(self, command: str, **parameters: Any) -> Any:
        """The answer to a command of WebDriver."""
        self._count += 1
        told = json.dumps([0, self._count, f"WebDriver:{command}", parameters]).encode()
        self._socket.sendall(b"%d:%b" % (len(told), told))
        _, number, wrong, answer = self._next()
        assert number == self._count
        assert wrong is None, wrong
        return answer

    def _next(self) -> Any:
        while b":" not in self._rest:
            self._receive()
        size, _, self._rest = self._rest.partition(b":")
        while len(self._rest) < int(size):
            self._receive()
        told, self._rest = self._rest[: int(size)], self._rest[int(size) :]
        return json.loads(told)

    def _receive(self) -> None:
        some = self._socket.recv(1 << 20)
        assert some, "the browser has ended"
        self._rest += some

    def navigate(self, address: str) -> None:
        """Go to an address."""
        self.call("Navigate", url=address)

    def run(self, script: str) -> Any:
        """See `Driver.run`."""
        done = (f"(async () => {{ {_HELPERS} {script} }})().then((it) => arguments[0]([it]),"
                " (error) => arguments[0](`${error}`));")
        found = self.call("ExecuteAsyncScript", script=done, args=[], sandbox=None)["value"]
        assert isinstance(found, list), found
        return found[0]
