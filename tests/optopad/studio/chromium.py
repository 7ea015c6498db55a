"""A real browser without a screen, with WebGL, spoken to over a socket in its own DevTools protocol.

Mouse and keys are the browser's own events, so a page is used as a person uses it. The graphics are computed
(SwiftShader): no GPU is needed, frames are slow. For pages of viser, whose inputs are found by their labels;
the report needs no WebGL: ``tests/optopad/report/browser.py``.
Source: Chrome DevTools Protocol, domains Target, Page, Runtime, Log, Emulation, Input.
"""

from __future__ import annotations

import base64
import json
import os
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from math import tan
from pathlib import Path
from string import ascii_letters, digits
from typing import Any

import numpy as np
import pytest
from websockets.sync.client import connect
from websockets.sync.connection import Connection

from tests.optopad.report.browser import KEY_CODES, NAMES, browser_path

Place = tuple[float, float]
Box = tuple[float, float, float, float]
needs_chromium = pytest.mark.skipif(browser_path() is None, reason=f"no browser: none of {', '.join(NAMES)}")

PATIENCE_S = 60.0
SETTLE_MS = 80  # viser holds a value back for 50 ms, and of several inputs keeps only the last
FLAGS = """--headless=new --no-sandbox --use-angle=swiftshader --enable-unsafe-swiftshader --hide-scrollbars
    --disable-dev-shm-usage --disable-background-networking --no-first-run --remote-debugging-port=0"""
NOT_OURS = "Unable to preventDefault inside passive"  # viser 1.1.1 at each press on what can be dragged
MODIFIERS = {"Alt": 1, "Control": 2, "Meta": 4, "Shift": 8}
CODES = {**KEY_CODES, "Escape": 27, "Backspace": 8, "Delete": 46, "PageUp": 33, "PageDown": 34}
CODES |= {key: ord(key.upper()) for key in ascii_letters + digits}

# The first of some elements that is visible, lies still and has nothing over its middle, as left, top, width, height.
STILL = """(async (elements) => {
  const frames = () => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
  const place = (e) => { const r = e.getBoundingClientRect(); return [r.left, r.top, r.width, r.height]; };
  for (const e of elements) {
    if (!e.checkVisibility({ visibilityProperty: true })) continue;
    e.scrollIntoView({ block: 'nearest', inline: 'nearest' });
    const before = place(e);
    await frames();
    const [x, y, w, h] = place(e);
    const top = document.elementFromPoint(x + w / 2, y + h / 2);
    const moves = String(before) !== String([x, y, w, h]);
    if (w && h && !moves && top && (top.contains(e) || e.contains(top))) return [x, y, w, h];
  }
})"""
SAYING = """((css, text) => [...document.body.querySelectorAll(css)].filter(
  (e) => e.textContent.trim().replace(/\\s+/g, ' ') === text || e.ariaLabel === text))"""
INNERMOST = f"""((text) => {SAYING}('*', text).filter(
  (e, i, all) => !all.some((other) => other !== e && e.contains(other))))"""
BESIDE = f"""((label, css, index) => {SAYING}('label', label).flatMap((e) => {{
  while (e && !e.querySelector(css)) e = e.parentElement;
  return e ? [...e.querySelectorAll(css)].slice(index, index + 1) : [];
}}))"""


class PageError(AssertionError):
    """The page threw an exception, or does not become what was asked."""


class Page:
    """One open page; `errors` are those of its console, and exceptions, up to the last command."""

    def __init__(self, socket: Connection) -> None:
        self._socket, self._last, self._session, self._loaded = socket, 0, "", False
        self.errors: list[str] = []
        targets = self.call("Target.getTargets")["targetInfos"]
        page = next(target["targetId"] for target in targets if target["type"] == "page")
        self._session = self.call("Target.attachToTarget", targetId=page, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """One command of the protocol and its answer."""
        self._last += 1
        message = {"id": self._last, "method": method, "params": parameters}
        self._socket.send(json.dumps(message | ({"sessionId": self._session} if self._session else {})))
        while (answer := self._read()).get("id") != self._last:
            pass
        if "error" in answer:
            raise PageError(f"{method}: {answer['error']}")
        return dict(answer["result"])

    def _read(self) -> dict[str, Any]:
        message: dict[str, Any] = json.loads(self._socket.recv(timeout=PATIENCE_S))
        method, told, error = message.get("method"), message.get("params", {}), ""
        if method == "Page.loadEventFired":
            self._loaded = True
        elif method == "Runtime.exceptionThrown":
            error = _exception(told["exceptionDetails"])
        elif method == "Runtime.consoleAPICalled" and told["type"] in ("error", "assert"):
            error = " ".join(str(a.get("value", a.get("description"))) for a in told["args"])
        elif method == "Log.entryAdded" and told["entry"]["level"] == "error":
            error = f"{told['entry']['text']} {told['entry'].get('url', '')}"
        if error and not error.startswith(NOT_OURS):
            self.errors.append(error.strip())
        return message

    def open(self, url: str) -> None:
        """Go to an address and wait until it has loaded."""
        self._loaded = False
        if failure := self.call("Page.navigate", url=url).get("errorText"):
            raise PageError(f"{url}: {failure}")
        while not self._loaded:
            self._read()

    def reload(self) -> None:
        """Load the page again."""
        self.open(self.evaluate("location.href"))

    def resize(self, width: int, height: int) -> None:
        """Another size of the window [px]."""
        size = {"width": width, "height": height, "deviceScaleFactor": 1}
        self.call("Emulation.setDeviceMetricsOverride", mobile=False, **size)
        self.settle()

    def evaluate(self, script: str) -> Any:
        """The value of an expression, or of its promise."""
        answer = self.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in answer:
            raise PageError(f"{_exception(answer['exceptionDetails'])}\nin {script}")
        return answer["result"].get("value")

    def settle(self) -> None:
        """Wait until the page has sent what was typed or clicked, and has drawn."""
        self.evaluate(f"new Promise((done) => setTimeout(() => requestAnimationFrame(done), {SETTLE_MS}))")

    def wait_for(self, condition: str, seconds: float = 30.0) -> Any:
        """Wait until an expression, or its promise, is true or an element; its value."""
        script = f"Promise.resolve({condition}).then((value) => value instanceof Node || value)"
        until = time.monotonic() + seconds
        while not (value := self.evaluate(script)):
            if time.monotonic() > until:
                raise PageError(f"not in {seconds} s: {condition}\n{self.errors}\npage: {self.text()!r}")
            time.sleep(0.05)
        return value

    def text(self) -> str:
        """What the page shows in words."""
        return str(self.evaluate("document.body.innerText"))

    def wait_for_text(self, text: str, seconds: float = 30.0) -> None:
        """Wait until the page shows a text."""
        self.wait_for(f"document.body.innerText.includes({json.dumps(text)})", seconds)

    def close_notes(self) -> None:
        """Close the notes over the page, such as viser's own that WebGL is slow."""
        notes = "document.querySelectorAll('.mantine-Notification-closeButton')"
        self.wait_for(f"({notes}.forEach((e) => e.click()), !{notes}.length)")

    def box(self, css: str, seconds: float = 10.0) -> Box:
        """Left, top, width and height [px] of the first visible element of a CSS selector."""
        return self._place(f"document.querySelectorAll({json.dumps(css)})", seconds)

    def text_box(self, text: str, seconds: float = 10.0) -> Box:
        """The same of the innermost element that says exactly a text, or has it as its ``aria-label``."""
        return self._place(f"{INNERMOST}({json.dumps(text)})", seconds)

    def input_box(self, label: str, css: str = "input:not([type=hidden]), textarea", index: int = 0) -> Box:
        """The same of the input beside a label; `index` picks one of a vector's."""
        return self._place(f"{BESIDE}({json.dumps(label)}, {json.dumps(css)}, {index})", 10.0)

    def _place(self, elements: str, seconds: float) -> Box:
        box: Box = tuple(self.wait_for(f"{STILL}({elements})", seconds))
        return box

    def _mouse(self, kind: str, x: float, y: float, **more: Any) -> None:
        self.call("Input.dispatchMouseEvent", type=f"mouse{kind}", x=x, y=y, **more)

    def move_to(self, x: float, y: float) -> None:
        """The pointer at a place [px], no button down."""
        self._mouse("Moved", x, y)

    def click_at(self, x: float, y: float) -> None:
        """A click of the left button at a place [px]."""
        self.drag((x, y), (x, y), steps=0)

    def click_text(self, text: str, seconds: float = 10.0) -> None:
        """A click on what says a text: a button, a tab, the title of a folder."""
        self.click_at(*middle(self.text_box(text, seconds)))

    def drag(self, start: Place, end: Place, steps: int = 12, seconds: float = 0.5) -> None:
        """Press the left button at one place [px], go in a straight line, let go at the other."""
        self.move_to(*start)
        self._mouse("Pressed", *start, button="left", buttons=1, clickCount=1)
        for step in range(1, steps + 1):
            time.sleep(seconds / steps)
            x, y = (a + (b - a) * step / steps for a, b in zip(start, end, strict=True))
            self._mouse("Moved", x, y, button="left", buttons=1)
        self._mouse("Released", *end, button="left", buttons=0, clickCount=1)
        self.settle()

    def slide(self, label: str, fraction: float) -> None:
        """Draw the thumb of a slider to a fraction of its track."""
        left, top, width, height = self.input_box(label, ".mantine-Slider-track")
        self.drag(middle(self.input_box(label, "[role=slider]")), (left + width * fraction, top + height / 2))

    def wheel_at(self, x: float, y: float, delta_y: float) -> None:
        """Turn the wheel at a place [px]; positive: away from the scene."""
        self._mouse("Wheel", x, y, deltaX=0, deltaY=delta_y)
        self.settle()

    def press(self, key: str) -> None:
        """A key as a keyboard sends it to whatever has the focus: ``Enter``, ``a``, ``Control+a``."""
        *held, key = key.split("+") if len(key) > 1 else [key]
        flags = sum(MODIFIERS[name] for name in held)
        text = "" if held else {"Enter": "\r", "Space": " "}.get(key, key if len(key) == 1 else "")
        commands = ["selectAll"] if (held, key) == (["Control"], "a") else []
        told = {"key": " " if key == "Space" else key, "windowsVirtualKeyCode": CODES.get(key, 0)}
        for kind in ("keyDown" if text else "rawKeyDown", "keyUp"):
            more = {"text": text, "commands": commands} if kind != "keyUp" else {}
            self.call("Input.dispatchKeyEvent", type=kind, modifiers=flags, **told, **more)

    def fill(self, label: str, value: object, index: int = 0) -> None:
        """Type a value into the number or text input beside a label, in place of what is there, and press Enter."""
        self.click_at(*middle(self.input_box(label, index=index)))
        for key in ("Control+a", *(str(value) or ["Delete"]), "Enter"):
            self.press(key)
        self.settle()

    def screenshot(self, path: Path | str) -> None:
        """Write what the window shows, as PNG."""
        Path(path).write_bytes(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))


def middle(box: Box) -> Place:
    """The middle of left, top, width, height."""
    return box[0] + box[2] / 2, box[1] + box[3] / 2


def screen_place(camera: Any, point: Sequence[float], canvas: Box | None = None) -> Place:
    """Where a point of the scene is on the page [px].

    Parameters
    ----------
    camera : of a viser client; its `wxyz` turns the camera's axes (right, down, ahead) into the scene's
    point : (3,) in the scene
    canvas : ``page.box("canvas")``; without it, the place is from the canvas' own corner
    """
    left, top, width, height = canvas or (0.0, 0.0, camera.image_width, camera.image_height)
    w, *axis = camera.wxyz
    away = np.subtract(point, camera.position)
    turn = np.cross(away, axis)
    x, y, z = map(float, away + 2 * w * turn + 2 * np.cross(turn, axis))
    assert z > 0, "the point is behind the camera"
    focal_px = height / 2 / tan(camera.fov / 2)
    return left + width / 2 + focal_px * x / z, top + height / 2 + focal_px * y / z


def _exception(details: dict[str, Any]) -> str:
    return str(details.get("exception", {}).get("description") or details["text"])


@contextmanager
def chromium_page(url: str, width: int = 1300, height: int = 800, dark: bool = False) -> Iterator[Page]:
    """A fresh browser with one page at an address; it ends with the block, and so does its folder.

    `dark` is what the reader's system asks for. viser does not ask: ``?darkMode`` in its address does it there.
    """
    path, quiet = browser_path() or NAMES[0], subprocess.DEVNULL
    with tempfile.TemporaryDirectory(prefix="optopad-chromium-", ignore_cleanup_errors=True) as folder:
        command = [path, *FLAGS.split(), f"--user-data-dir={folder}", "about:blank"]
        env = os.environ | {"TMPDIR": folder}
        process = subprocess.Popen(command, env=env, stdout=quiet, stderr=quiet, start_new_session=True)
        try:
            address = _address(Path(folder) / "DevToolsActivePort", process)
            with connect(address, proxy=None, max_size=None, max_queue=None, ping_interval=None) as socket:
                page = Page(socket)
                page.resize(width, height)
                scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
                page.call("Emulation.setEmulatedMedia", features=[scheme])
                page.open(url)
                yield page
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def _address(port_file: Path, process: subprocess.Popen[bytes]) -> str:
    until = time.monotonic() + PATIENCE_S
    while not port_file.exists() or "\n" not in port_file.read_text():
        assert process.poll() is None, f"the browser ended with {process.returncode}"
        assert time.monotonic() < until, "the browser opens no port"
        time.sleep(0.05)
    return "ws://127.0.0.1:" + "".join(port_file.read_text().split())  # a line of port, a line of path
