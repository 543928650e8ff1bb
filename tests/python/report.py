"""Opens a report in headless Chromium and looks for its curves.

    python report.py REPORT.html SCREENSHOTS

At 1280 and at 400 pixels width the page must write nothing to the console, ask for nothing outside itself, be no wider
than the window, break no number in two lines, and show every plot: pixels of each curve's own colour inside the plot's
box, found in a screenshot, and every word of it within that box. On paper no table may reach beyond the sheet.
The screenshots stay in the folder SCREENSHOTS. Before the report, a page with one fault of each kind is opened, so
that a check that sees nothing is found out.

Chromium is spoken to over a pair of pipes (--remote-debugging-pipe); nothing but it and Pillow is needed.

Exit status: 0 where all is well, 1 where anything is not, 2 for a wrong call.
"""

import base64
import io
import json
import os
import select
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from PIL import Image

WIDTHS = (1280, 400)
HEIGHT = 900
PATIENCE = 60.0
# A curve is at least a marker, and a map's cell is much more; the dots of a band of colours may be fewer.
PIXELS = {"curve": 40, "cell": 200, "dots": 4}
# How far a channel may be from the colour asked for.
NEAR = 12

# Boxes in pixels of the page, with the colours that must be seen in each.
PLOTS = """
JSON.stringify([...document.querySelectorAll('svg')].map(svg => {
  const box = svg.getBoundingClientRect();
  return {
    title: svg.querySelector('title')?.textContent ?? '',
    label: svg.getAttribute('aria-label') ?? '',
    box: [box.left + scrollX, box.top + scrollY, box.width, box.height],
    font: Math.min(...[...svg.querySelectorAll('text')].map(t =>
      parseFloat(getComputedStyle(t).fontSize) * box.width / svg.viewBox.baseVal.width)),
    marks: [...svg.querySelectorAll('.curve, .cell, .dots')].map(mark => ({
      kind: ['curve', 'cell', 'dots'].find(kind => mark.classList.contains(kind)),
      name: mark.dataset.name ?? mark.dataset.colour,
      colour: mark.dataset.colour,
      length: [...mark.querySelectorAll('polyline')].reduce((sum, line) => sum + line.getTotalLength(), 0)
        * box.width / svg.viewBox.baseVal.width,
    })),
  };
}))
"""

# Words of plots that reach beyond the plot, and numbers that are broken in two lines.
TEXTS = r"""
(() => {
  const cut = [], broken = [];
  for (const svg of document.querySelectorAll('svg')) {
    const box = svg.getBoundingClientRect();
    for (const text of svg.querySelectorAll('text')) {
      const own = text.getBoundingClientRect();
      if (own.width && (own.left < box.left - 1 || own.right > box.right + 1 || own.top < box.top - 1
          || own.bottom > box.bottom + 1)) cut.push(text.textContent);
    }
  }
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (texts.nextNode()) {
    const node = texts.currentNode;
    if (node.parentElement.closest('svg, script, style, pre')) continue;
    for (const number of node.data.matchAll(/-?\d[\d.]*(e[-+]?\d+)?/g)) {
      const range = document.createRange();
      range.setStart(node, number.index);
      range.setEnd(node, number.index + number[0].length);
      const lines = new Set([...range.getClientRects()].filter(r => r.width > 0).map(r => Math.round(r.top)));
      if (lines.size > 1) broken.push(number[0]);
    }
  }
  return JSON.stringify({cut, broken});
})()
"""

# Tables that are wider than what holds them: on paper nobody can scroll.
TOO_WIDE = """
JSON.stringify([...document.querySelectorAll('table')].filter(table => {
  const box = table.getBoundingClientRect();
  return box.right > document.documentElement.clientWidth + 1;
}).map(table => table.innerText.slice(0, 60)))
"""
# The printable width of a sheet of A4 with Chromium's margins, in pixels.
SHEET = 718

# What the sections that are not from the study hold.
SECTIONS = """
(() => {
  const names = id => [...document.querySelectorAll(`#${id} .curve`)].map(curve => curve.dataset.name);
  return JSON.stringify({
    drift: names('drift'),
    stability: document.querySelectorAll('#stability .cell').length,
    division: document.querySelectorAll('#stability .division').length === 1,
    cost: names('cost'),
    points: [...document.querySelectorAll('#cost .pareto')].map(line => line.points.length),
  });
})()
"""

FAULTS = """<!DOCTYPE html><html><head><title>faults</title></head><body>
<img src="https://example.org/outside.png" alt="">
<script>console.error('planted');</script>
<div style="width: 3000px; height: 1px"></div>
<svg class="plot" viewBox="0 0 100 100" aria-label="faulty" width="300">
<title>faulty</title>
<text x="1" y="9" font-size="9">t</text>
<text x="90" y="50" font-size="9">beyond its plot</text>
<g class="curve" data-name="unseen" data-colour="#0072b2"></g>
</svg>
<p style="width: 2em; overflow-wrap: anywhere">3.40e-2718281828</p>
<table style="width: 2000px"><tr><td>a wide table</td></tr></table></body></html>
"""


class Browser:
    """Chromium, and the messages it sends."""

    def __init__(self, profile):
        program = shutil.which("chromium") or shutil.which("chromium-browser")
        if program is None:
            raise SystemExit("chromium is not installed: apt-get install chromium")
        to_read, self.to_browser = os.pipe()
        self.from_browser, to_write = os.pipe()

        def connect():
            # Chromium reads from 3 and writes to 4. Copies first, since either may be in the other's place.
            os.dup2(to_read, 103)
            os.dup2(to_write, 104)
            os.dup2(103, 3)
            os.dup2(104, 4)

        self.process = subprocess.Popen(
            [
                program,
                "--headless=new",
                "--no-sandbox",
                "--disable-gpu",
                "--disable-dev-shm-usage",
                "--disable-background-networking",
                "--no-first-run",
                "--hide-scrollbars",
                "--force-color-profile=srgb",
                "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
                "--remote-debugging-pipe",
                f"--user-data-dir={profile}",
            ],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            close_fds=False,
            preexec_fn=connect,
        )
        os.close(to_read)
        os.close(to_write)
        self.number = 0
        self.rest = b""
        self.events = []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = None
        attached = self.call("Target.attachToTarget", targetId=target, flatten=True)
        self.session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def message(self):
        """The next message from the browser."""
        end = time.monotonic() + PATIENCE
        while b"\0" not in self.rest:
            ready, _, _ = select.select([self.from_browser], [], [], max(0.0, end - time.monotonic()))
            part = os.read(self.from_browser, 1 << 20) if ready else b""
            if not part:
                raise SystemExit("chromium went away or is silent")
            self.rest += part
        text, self.rest = self.rest.split(b"\0", 1)
        return json.loads(text)

    def call(self, method, **parameters):
        self.number += 1
        request = {"id": self.number, "method": method, "params": parameters}
        if getattr(self, "session", None):
            request["sessionId"] = self.session
        os.write(self.to_browser, json.dumps(request).encode() + b"\0")
        while True:
            message = self.message()
            if message.get("id") == self.number:
                if "error" in message:
                    raise SystemExit(f"{method}: {message['error']['message']}")
                return message["result"]
            self.events.append(message)

    def evaluate(self, expression):
        return self.call("Runtime.evaluate", expression=expression, returnByValue=True)["result"]["value"]

    def open(self, address, width):
        """Opens a page and returns what it said and asked for."""
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=HEIGHT, deviceScaleFactor=1, mobile=False)
        self.events = []
        self.call("Page.navigate", url=address)
        end = time.monotonic() + PATIENCE
        while self.evaluate("document.readyState") != "complete" and time.monotonic() < end:
            time.sleep(0.05)
        time.sleep(0.3)
        self.evaluate("0")
        return self.events

    def screenshot(self):
        size = self.call("Page.getLayoutMetrics")["cssContentSize"]
        clip = {"x": 0, "y": 0, "width": size["width"], "height": size["height"], "scale": 1}
        data = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=True, clip=clip)["data"]
        return Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB")

    def close(self):
        self.process.terminate()
        self.process.wait()


def count(image, colour):
    """Pixels of about this colour."""
    wanted = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
    masks = [
        channel.point(lambda v, w=w: 255 if abs(v - w) <= NEAR else 0)
        for channel, w in zip(image.split(), wanted)
    ]
    both = Image.composite(masks[0], Image.new("L", image.size), masks[1])
    return Image.composite(both, Image.new("L", image.size), masks[2]).histogram()[255]


def missing(browser):
    """What of the sections on energy, stability and cost the open page lacks."""
    wrong = []
    seen = json.loads(browser.evaluate(SECTIONS))
    schemes = [f"gimp+{integrator}" for integrator in ("cd", "usl", "usf", "musl")]
    if seen["drift"] != 2 * schemes:
        wrong.append(f"the curves of energy are {seen['drift']}, not {2 * schemes}")
    if seen["stability"] != 16 or not seen["division"]:
        wrong.append(f"the map of limits has {seen['stability']} cells, not 16, and the line {seen['division']}")
    if seen["cost"] != ["front", "front"] or min(seen["points"]) < 8:
        wrong.append(f"the plots of cost show {seen['cost']}, with {seen['points']} settings on the fronts")
    return wrong


def inspect(browser, address, width, picture):
    """All that is wrong with a page at this width, and how many plots and curves it has."""
    wrong = []
    for event in browser.open(address, width):
        method, parameters = event.get("method"), event.get("params", {})
        if method == "Runtime.consoleAPICalled":
            said = " ".join(str(a.get("value", "")) for a in parameters["args"])
            wrong.append(f"console: {parameters['type']}: {said}")
        elif method == "Runtime.exceptionThrown":
            wrong.append(f"console: exception: {parameters['exceptionDetails'].get('text')}")
        elif method == "Log.entryAdded":
            wrong.append(f"console: {parameters['entry']['text']}")
        elif method == "Network.requestWillBeSent":
            asked = parameters["request"]["url"]
            if asked != address and not asked.startswith("data:"):
                wrong.append(f"outside request: {asked}")
    texts = json.loads(browser.evaluate(TEXTS))
    wrong += [f"words beyond their plot: {text}" for text in texts["cut"]]
    wrong += [f"a number in two lines: {number}" for number in texts["broken"]]
    total = browser.evaluate("document.documentElement.scrollWidth")
    if total > width:
        wrong.append(f"the page is {total} pixels wide")
    image = browser.screenshot()
    image.save(picture)
    plots = json.loads(browser.evaluate(PLOTS))
    for plot in plots:
        title, (left, top, across, down) = plot["title"], plot["box"]
        if not plot["label"]:
            wrong.append(f"{title}: no words for a screen reader")
        if across < 200 or left < 0 or left + across > width + 1:
            wrong.append(f"{title}: from {left:.0f} to {left + across:.0f} pixels")
        if plot["font"] < 9:
            wrong.append(f"{title}: letters of {plot['font']:.1f} pixels")
        box = image.crop((int(left), int(top), int(left + across), int(top + down)))
        # Below this are the legend's own lines, which prove nothing.
        inside = box.crop((0, 0, box.width, int(box.width * 370 / 480)))
        if not plot["marks"]:
            wrong.append(f"{title}: nothing drawn")
        for mark in plot["marks"]:
            found = count(inside, mark["colour"])
            # A short curve, of runs that stopped but for two, has fewer, and gaps.
            least = PIXELS[mark["kind"]]
            if found < (min(least, 0.4 * mark["length"]) if mark["length"] else least):
                wrong.append(f"{title}: {mark['name']} is not visible: {found} pixels of {mark['colour']}")
    return wrong, len(plots), sum(len(plot["marks"]) for plot in plots)


def printed(browser):
    """What of the open page a sheet of paper does not hold."""
    browser.call("Emulation.setEmulatedMedia", media="print")
    browser.call("Emulation.setDeviceMetricsOverride", width=SHEET, height=HEIGHT, deviceScaleFactor=1, mobile=False)
    wide = json.loads(browser.evaluate(TOO_WIDE))
    browser.call("Emulation.setEmulatedMedia", media="")
    return [f"on paper, a table is cut: {table}" for table in wide]


def main(arguments):
    if len(arguments) != 2:
        print("usage: python report.py REPORT.html SCREENSHOTS", file=sys.stderr)
        return 2
    report, pictures = Path(arguments[0]).resolve(), Path(arguments[1])
    if not report.is_file():
        print(f"{report}: no such file", file=sys.stderr)
        return 2
    pictures.mkdir(parents=True, exist_ok=True)
    failed = 0
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        browser = Browser(f"{folder}/profile")
        try:
            faulty = Path(folder) / "faults.html"
            faulty.write_text(FAULTS, encoding="utf-8")
            wrong, _, _ = inspect(browser, faulty.as_uri(), WIDTHS[0], f"{folder}/faults.png")
            wrong += printed(browser)
            planted = (
                "console: error: planted",
                "outside request",
                "pixels wide",
                "unseen is not visible",
                "beyond its plot",
                "a number in two lines: 3.40e-2718281828",
                "on paper, a table is cut: a wide table",
            )
            for part in planted:
                if not any(part in line for line in wrong):
                    failed += 1
                    print(f"FAILED: the planted fault '{part}' was not found in {wrong}")
            for width in WIDTHS:
                picture = pictures / f"report-{width}.png"
                wrong, plots, marks = inspect(browser, report.as_uri(), width, picture)
                # Space, time, two pictures, energy and cost for each problem, three of differences, and a map of limits.
                if plots != 16:
                    wrong.append(f"{plots} plots, not 16")
                wrong += missing(browser) + printed(browser)
                failed += len(wrong)
                print(f"{width} pixels: {plots} plots, {marks} curves and colours; {picture}")
                for line in wrong:
                    print(f"FAILED at {width} pixels: {line}")
        finally:
            browser.close()
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
