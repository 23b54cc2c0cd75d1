"""Opens a report.html in Firefox and prints what was found as JSON, or {"skipped": why} where there is no Firefox.

    python check_report_firefox.py report.html [--screenshots FOLDER]

Twice: on a display that Xvfb makes, where Mesa draws in software, and headless, where Firefox has no WebGL 2 at all, as on a
machine whose driver is not trusted. The browser is that of FIREFOX, or `firefox-esr`, or `firefox`; it is driven by WebDriver
BiDi, which it speaks itself.
"""

import argparse
import asyncio
import base64
import io
import json
import os
import re
import shutil
import signal
import subprocess
import tempfile
from pathlib import Path

import websockets
from PIL import Image, ImageChops

PREFERENCES = {
    "webgl.force-enabled": True,
    "browser.shell.checkDefaultBrowser": False,
    "browser.aboutwelcome.enabled": False,
    "datareporting.policy.dataSubmissionEnabled": False,
    "app.normandy.enabled": False,
    "toolkit.telemetry.enabled": False,
}
STARTED = re.compile(r"WebDriver BiDi listening on (ws://\S+)")


class Firefox:
    """A Firefox with a profile of its own."""

    def __init__(self, program, headless):
        self.profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        lines = [f"user_pref({json.dumps(k)}, {json.dumps(v)});" for k, v in PREFERENCES.items()]
        Path(self.profile.name, "user.js").write_text("\n".join(lines))
        command = [program, "--profile", self.profile.name, "--no-remote", "--remote-debugging-port", "0",
                   "--width", "1100", "--height", "900"]
        if headless:
            command.append("--headless")
        else:
            command = ["xvfb-run", "-a", "-s", "-screen 0 1280x1000x24", *command]
        environment = dict(os.environ, HOME=self.profile.name, LIBGL_ALWAYS_SOFTWARE="1")
        self.log = Path(self.profile.name, "log")
        self.process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=self.log.open("w"), env=environment,
                                        start_new_session=True)
        self.number = 0
        self.events = []

    async def connect(self):
        for _ in range(600):
            address = STARTED.search(self.log.read_text(errors="replace"))
            if address or self.process.poll() is not None:
                break
            await asyncio.sleep(0.1)
        if not address:
            raise RuntimeError("Firefox does not start: " + self.log.read_text(errors="replace")[-600:])
        self.socket = await websockets.connect(address[1] + "/session", max_size=None)
        await self.call("session.new", capabilities={})
        await self.call("session.subscribe", events=["log.entryAdded", "network.beforeRequestSent"])
        self.context = (await self.call("browsingContext.getTree"))["contexts"][0]["context"]

    async def call(self, method, **parameters):
        self.number += 1
        await self.socket.send(json.dumps({"id": self.number, "method": method, "params": parameters}))
        while True:
            answer = json.loads(await asyncio.wait_for(self.socket.recv(), 120))
            if answer.get("id") != self.number:
                self.events.append(answer)
            elif "error" in answer:
                raise RuntimeError(f"{method}: {answer['message']}")
            else:
                return answer["result"]

    async def value(self, expression):
        """The value of an expression in the page, as JSON."""
        text = await self.call("script.evaluate", expression=f"(async () => JSON.stringify(await ({expression})))()",
                               target={"context": self.context}, awaitPromise=True)
        if text["type"] != "success":
            raise RuntimeError(f"{expression}: {text['exceptionDetails']['text']}")
        return json.loads(text["result"].get("value", "null"))

    async def drawn(self):
        """Waits until the viewer is at rest, and says so or that it failed."""
        for _ in range(1200):
            state = await self.value("document.documentElement.dataset.viewer ?? null")
            if state in ("ready", "failed"):
                return state
            await asyncio.sleep(0.05)
        return state

    async def pixels(self):
        data = await self.value("(topipe.draw(), topipe.canvas.toDataURL('image/png'))")
        return Image.open(io.BytesIO(base64.b64decode(data.split(",")[1]))).convert("RGB")

    def close(self):
        # Xvfb, the browser and its processes are one session of their own.
        os.killpg(self.process.pid, signal.SIGTERM)
        try:
            self.process.wait(20)
        except subprocess.TimeoutExpired:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()
        self.profile.cleanup()


def share(image, reference):
    """The share of pixels that differ visibly."""
    difference = ImageChops.difference(image, reference).convert("L").point(lambda v: 255 if v > 12 else 0)
    return difference.histogram()[255] / (image.width * image.height)


async def look(program, report, screenshots, headless):
    firefox = Firefox(program, headless)
    found = {}
    try:
        await firefox.connect()
        address = report.resolve().as_uri()
        await firefox.call("browsingContext.navigate", context=firefox.context, url=address, wait="complete")
        found["viewer"] = await firefox.drawn()
        found["browser"] = await firefox.value("navigator.userAgent.split(' ').at(-1)")
        if found["viewer"] == "ready":
            await draw(firefox, found)
        else:
            found["note"] = await firefox.value("document.querySelector('#viewer').innerText")
            found["pictures"] = await firefox.value(
                "[...document.querySelectorAll('.pictures img')].filter((i) => i.checkVisibility() && i.naturalWidth > 0).length")
        found["figures"] = await firefox.value("document.querySelectorAll('#figures tbody tr').length")
        if screenshots:
            screenshots.mkdir(parents=True, exist_ok=True)
            shot = await firefox.call("browsingContext.captureScreenshot", context=firefox.context, origin="document")
            name = "firefox-without-webgl.png" if headless else "firefox.png"
            (screenshots / name).write_bytes(base64.b64decode(shot["data"]))
        # The page itself; what Firefox asks for on its own has another address.
        events = [e["params"] for e in firefox.events if e.get("params", {}).get("context", firefox.context) == firefox.context]
        # Without WebGL the browser itself says so in the console.
        found["messages"] = [e["text"] for e in events if e.get("level") in ("error", "warn") and "WebGL" not in (e["text"] or "")]
        requests = [e["request"]["url"] for e in events if "request" in e]
        found["requests"] = [r[:120] for r in requests if not r.startswith(("data:", address, "about:", "blob:"))]
    finally:
        firefox.close()
    return found


async def draw(firefox, found):
    """Layers, section plane and keyboard, as in check_report.py."""
    found["presets"] = {}
    await firefox.value("[...topipe.controls.root.querySelectorAll('[data-layer]:checked')].map((box) => box.dataset.layer)"
                        ".forEach((id) => topipe.controls.root.querySelector(`[data-layer='${id}']`).click())")
    bare = await firefox.pixels()
    for name in await firefox.value("[...document.querySelectorAll('button.preset')].map((b) => b.textContent)"):
        await firefox.value(f"[...document.querySelectorAll('button.preset')].find((b) => b.textContent === {json.dumps(name)}).click()")
        found["presets"][name] = share(await firefox.pixels(), bare)
    await firefox.value("document.querySelector('button.preset').click()")
    whole = await firefox.pixels()
    await firefox.value("topipe.cutAcross('0')")
    found["cut_share"] = share(await firefox.pixels(), whole)
    await firefox.value("topipe.cutAcross('')")
    await firefox.value("topipe.canvas.focus()")
    keys = [{"type": kind, "value": "\ue012"} for kind in ("keyDown", "keyUp") * 2]
    await firefox.call("input.performActions", context=firefox.context, actions=[{"type": "key", "id": "k", "actions": keys}])
    await firefox.drawn()
    found["turned_share"] = share(await firefox.pixels(), whole)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("report", type=Path)
    parser.add_argument("--screenshots", type=Path)
    arguments = parser.parse_args()
    names = [os.environ.get("FIREFOX"), "firefox-esr", "firefox"]
    program = next((path for name in names if name and (path := shutil.which(name))), None)
    if not program:
        return print(json.dumps({"skipped": "no Firefox was found: install firefox-esr, or name one in FIREFOX"}))
    found = {"without": asyncio.run(look(program, arguments.report, arguments.screenshots, True))}
    if shutil.which("xvfb-run"):
        found["with"] = asyncio.run(look(program, arguments.report, arguments.screenshots, False))
    print(json.dumps(found, indent=1))


main()
