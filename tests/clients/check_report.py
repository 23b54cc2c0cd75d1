"""Opens a report.html in headless Chromium, as someone would who was mailed it, and prints what was found as JSON.

    python check_report.py report.html [--screenshots FOLDER]
    python check_report.py report.html --picture report.png

The second form takes one picture of what is seen first, for the README.

The browser is that of CHROMIUM, or `chromium`, or `google-chrome`; it draws in software. Looked at: messages of the
console, requests, pixels of the model, layers, section plane, keyboard, names of the controls, and the contrast of texts.
"""

import argparse
import base64
import io
import json
import os
import shutil
import sys
from pathlib import Path

from PIL import Image, ImageChops
from playwright.sync_api import TimeoutError, sync_playwright

FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]

# Contrast of each element with text of its own, by the formula of WCAG 2; backgrounds are looked for upwards.
CONTRAST = """() => {
  const parse = (text) => { const m = text.match(/[\\d.]+/g).map(Number); return m.length > 3 ? m : [...m, 1]; };
  const light = ([r, g, b]) => [r, g, b].map((c) => c / 255).map((c) => (c <= 0.03928 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4))
    .reduce((sum, c, k) => sum + c * [0.2126, 0.7152, 0.0722][k], 0);
  const worst = { ratio: 99, text: '' };
  for (const node of document.querySelectorAll('body *')) {
    if (!node.checkVisibility() || node.closest('svg, noscript, script')) continue;
    const own = [...node.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
    if (!own || node.closest('.hidden')) continue;
    const style = getComputedStyle(node);
    let ground = [255, 255, 255, 1];
    for (let at = node; at; at = at.parentElement) {
      const color = parse(getComputedStyle(at).backgroundColor);
      if (color[3] > 0.5) { ground = color; break; }
    }
    const [a, b] = [light(parse(style.color)), light(ground)].sort((x, y) => y - x);
    const ratio = (a + 0.05) / (b + 0.05);
    if (ratio < worst.ratio) Object.assign(worst, { ratio, text: node.textContent.trim().slice(0, 60) });
  }
  return worst;
}"""

# Two seconds of turning: frames a second, and what they are drawn with.
TURNING = """async () => {
  let frames = 0;
  const update = topipe.annotations.update;
  topipe.annotations.update = function () { frames++; update.call(this); };
  const end = performance.now() + 2000;
  while (performance.now() < end) {
    topipe.camera.turn(1.5, 0);
    topipe.moving();
    await new Promise((next) => requestAnimationFrame(next));
  }
  delete topipe.annotations.update;
  const { canvas } = topipe;
  return { fps: frames / 2, triangles: topipe.budget, of: topipe.renderer.triangles(topipe.view(1)), canvas: [canvas.width, canvas.height] };
}"""

NAMELESS = """() => [...document.querySelectorAll('button, input, select, canvas, a[href], [role=img], [role=region]')]
  .filter((n) => n.checkVisibility() && !(n.getAttribute('aria-label') || n.textContent.trim() || n.labels?.length || n.title))
  .map((n) => n.outerHTML.slice(0, 80))"""


def browser_path():
    for name in [os.environ.get("CHROMIUM"), "chromium", "chromium-browser", "google-chrome"]:
        path = name and shutil.which(name)
        if path:
            return path
    sys.exit("no Chromium was found: install the Debian package `chromium`, or name one in CHROMIUM")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("report", type=Path)
    parser.add_argument("--screenshots", type=Path)
    parser.add_argument("--flag", action="append", default=[], help="one more for Chromium, as --flag=--disable-gpu-compositing")
    parser.add_argument("--picture", type=Path, help="take one picture of the top of the page, and nothing else")
    arguments = parser.parse_args()
    found = {"messages": [], "requests": [], "screenshots": {}}

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=browser_path(), args=FLAGS + arguments.flag)
        if arguments.picture:
            page = browser.new_page(viewport={"width": 1280, "height": 1250})
            page.goto(arguments.report.resolve().as_uri())
            page.wait_for_selector("html[data-viewer=ready]", state="attached", timeout=60000)
            page.screenshot(path=arguments.picture)
            browser.close()
            return
        found["browser"] = browser.version
        page = browser.new_page(viewport={"width": 960, "height": 640})
        page.on("console", lambda m: found["messages"].append(f"{m.type}: {m.text}"))
        page.on("pageerror", lambda e: found["messages"].append(f"error: {e}"))
        page.on("request", lambda r: found["requests"].append(r.url[:120]))
        address = arguments.report.resolve().as_uri()
        page.goto(address)
        drawn = lambda: page.wait_for_selector("html[data-viewer=ready], html[data-viewer=failed]", state="attached", timeout=60000)
        drawn()
        found["viewer"] = page.evaluate("document.documentElement.dataset.viewer")
        found["title"] = page.title()
        canvas = page.locator("canvas")

        def look(name=None):
            """The canvas as an image, once everything asked for is drawn."""
            drawn()
            page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
            image = Image.open(io.BytesIO(canvas.screenshot())).convert("RGB")
            if name and arguments.screenshots:
                arguments.screenshots.mkdir(parents=True, exist_ok=True)
                image.save(arguments.screenshots / f"{name}.png")
            return image

        def pixels(name=None):
            """What the graphics card has drawn, without what is written over it: quicker than a picture of the page."""
            address = page.evaluate("() => { topipe.draw(); return topipe.canvas.toDataURL('image/png'); }")
            image = Image.open(io.BytesIO(base64.b64decode(address.split(",")[1]))).convert("RGB")
            if name and arguments.screenshots:
                image.save(arguments.screenshots / f"{name}.png")
            return image

        def share(image, reference):
            """The share of pixels that differ visibly."""
            difference = ImageChops.difference(image, reference).convert("L").point(lambda v: 255 if v > 12 else 0)
            return difference.histogram()[255] / (image.width * image.height)

        if found["viewer"] == "ready":
            # Nothing shown: what the model is compared with.
            first = look("first")
            boxes = page.locator(".panel input[data-layer]")
            shown = [b.get_attribute("data-layer") for b in boxes.all() if b.is_checked()]
            for layer in shown:
                page.locator(f"input[data-layer='{layer}']").uncheck()
            empty = look()
            bare = pixels()
            found["layers"] = {}
            found["shown_at_first"] = shown
            found["model_share"] = share(first, empty)
            for box in boxes.all():
                box.check()
                layer = box.get_attribute("data-layer")
                if layer == "labels":
                    found["labels"] = page.locator(".overlay .label").count()
                else:
                    found["layers"][layer] = share(pixels(), bare)
                box.uncheck()
            found["presets"] = {}
            for button in page.locator("button.preset").all():
                name = button.inner_text()
                button.click()
                found["presets"][name] = share(pixels(f"preset-{len(found['presets'])}"), bare)
                if not button.evaluate("node => node.getAttribute('aria-pressed') === 'true'"):
                    found["messages"].append(f"error: preset {name} is not marked as pressed")
            page.locator("button.preset").first.click()
            whole = look()
            page.locator("#cut-axis").select_option("0")
            cut = look("cut")
            found["cut_share"] = share(cut, whole)
            slider = page.locator("#cut-at")
            slider.focus()
            for _ in range(40):
                slider.press("ArrowRight")
            found["cut_moved_share"] = share(look(), cut)
            page.locator("#cut-axis").select_option("")
            found["cut_undone_share"] = share(look(), whole)
            canvas.focus()
            canvas.press("ArrowLeft")
            canvas.press("ArrowLeft")
            found["turned_share"] = share(look(), whole)
            canvas.press("1")
            found["back_share"] = share(look(), whole)
            canvas.press("+")
            found["zoomed_share"] = share(look(), whole)
            canvas.press("f")
            drawn()
            found["turning"] = page.evaluate(TURNING)
            drawn()
            found["turning"]["rest"] = page.evaluate("[topipe.canvas.width, topipe.canvas.height]")
            canvas.press("1")
            found["turned_back_share"] = share(look(), whole)
            place = page.locator("button.place").first
            if place.count():
                place.click()
                page.locator(".marker").wait_for(state="attached", timeout=5000)
                found["marker"] = page.locator(".marker").count()
                page.locator("canvas").press("f")
            # The first place where the model is, row by row from the middle.
            model = look()
            spots = [(x, y) for y in range(0, 9) for x in range(-8, 9)]
            middle = (model.width // 2, model.height // 2)
            differs = ImageChops.difference(model, empty).convert("L").load()
            spot = next(((x, y) for x, y in ((middle[0] + 20 * a, middle[1] + 12 * b) for a, b in spots) if differs[x, y] > 12), middle)
            canvas.hover(position={"x": spot[0], "y": spot[1]})
            tip = page.locator(".tip")
            try:
                tip.wait_for(state="visible", timeout=5000)
                found["tip"] = tip.inner_text()
            except TimeoutError:
                found["tip"] = ""
        found["contrast"] = page.evaluate(CONTRAST)
        found["nameless"] = page.evaluate(NAMELESS)
        found["headings"] = [h.inner_text() for h in page.locator("h1, h2").all()]
        found["broken"] = page.locator("tr.broken").count()
        if arguments.screenshots:
            page.screenshot(path=arguments.screenshots / "page.png", full_page=True)
        browser.close()
    found["requests"] = [r for r in found["requests"] if r != address[:120]]
    print(json.dumps(found, indent=1))


main()
