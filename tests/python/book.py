"""Opens every page of the built book in headless Chromium.

    python book.py BOOK SCREENSHOTS

At 1280 pixels in light colours and at 400 pixels in dark ones a page must write nothing to the console, ask for nothing from another host, be no
wider than the window, show every picture, have every formula set, and have words that can be told from their ground. Links within the book
must lead to a page and, with a mark, to a place there. The search finds a page by a word of it. Screenshots of some pages stay in the folder
SCREENSHOTS. Before the book, a page with one fault of each kind is opened, so that a check that sees nothing is found out.

Exit status: 0 where all is well, 1 where anything is not, 2 for a wrong call.
"""

import functools
import http.server
import json
import sys
import tempfile
import threading
import time
from pathlib import Path
from urllib.parse import unquote, urljoin, urlsplit

from report import Browser

VIEWS = {"light": 1280, "dark": 400}
PICTURES = ["introduction", "guide/converging", "theory/updated", "theory/histories", "reference/laws", "results/gallery", "tutorials/mpm-cpp"]
# The least contrast of text, by WCAG 2.2 (1.4.3) for large text; code is coloured by mdBook's own themes.
CONTRAST = 3.0

SEEN = r"""
(() => {
  const main = document.querySelector('main') ?? document.body;
  const links = [...document.querySelectorAll('a[href]')].map(a => a.getAttribute('href'));
  const ids = [...document.querySelectorAll('[id], a[name]')].map(e => e.id || e.name);
  const images = [...main.querySelectorAll('img')].filter(i => i.loading !== 'lazy' || i.complete)
    .filter(i => !i.naturalWidth).map(i => i.getAttribute('src'));
  const unset = [];
  const words = document.createTreeWalker(main, NodeFilter.SHOW_TEXT);
  const faint = new Set();
  const channels = text => (text.match(/[\d.]+/g) ?? [0, 0, 0, 0]).map(Number);
  const light = ([r, g, b]) => [r, g, b].map(c => c / 255)
    .map(c => c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4)
    .reduce((sum, c, i) => sum + c * [0.2126, 0.7152, 0.0722][i], 0);
  while (words.nextNode()) {
    const parent = words.currentNode.parentElement, text = words.currentNode.data.trim();
    if (!text || parent.closest('script, style, svg')) continue;
    if (!parent.closest('code, pre') && /\$(?![A-Z]{3})[^\s$][^$]*\$|\\[a-z]+\{|&[a-z]+;/.test(text)) unset.push(text.slice(0, 60));
    if (parent.closest('merror')) unset.push('merror: ' + text.slice(0, 60));
    if (parent.closest('pre')) continue;
    let ground = parent;
    while (ground && (channels(getComputedStyle(ground).backgroundColor)[3] ?? 1) === 0) ground = ground.parentElement;
    const below = ground ? channels(getComputedStyle(ground).backgroundColor) : [255, 255, 255];
    const [a, b] = [light(channels(getComputedStyle(parent).color)), light(below)].sort((x, y) => y - x);
    const contrast = (a + 0.05) / (b + 0.05);
    if (contrast < CONTRAST) faint.add(`${contrast.toFixed(1)}: ${text.slice(0, 40)}`);
  }
  return JSON.stringify({links, ids, images, unset, faint: [...faint], width: document.documentElement.scrollWidth,
    formulas: document.querySelectorAll('math').length});
})()
""".replace("CONTRAST", str(CONTRAST))

FAULTS = """<!DOCTYPE html><html><head><title>faults</title></head><body style="background: white"><main>
<img src="nowhere.png" alt=""> <a href="nowhere.html">a</a> <a href="#nowhere">b</a> $x_i$
<script>console.error('planted'); fetch('https://example.org/').catch(() => {});</script>
<div style="width: 3000px; height: 1px"></div><p style="color: #ddd">faint</p></main></body></html>
"""
PLANTED = ["console: error: planted", "another host: https://example.org/", "pixels wide", "the picture nowhere.png", "faint", "not set: ", "no page nowhere.html", "no place #nowhere"]


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


def look(browser, address, name, view):
    """What is wrong with a page in a view, and what there is to be seen."""
    wrong = []
    dark = [{"name": "prefers-color-scheme", "value": view}]
    browser.call("Emulation.setEmulatedMedia", features=dark)
    host = urlsplit(address).netloc
    for event in browser.open(f"{address}/{name}", VIEWS[view]):
        method, parameters = event.get("method"), event.get("params", {})
        if method == "Runtime.consoleAPICalled":
            wrong.append(f"console: {parameters['type']}: {' '.join(str(a.get('value', '')) for a in parameters['args'])}")
        elif method == "Runtime.exceptionThrown":
            wrong.append(f"console: exception: {parameters['exceptionDetails'].get('text')}")
        elif method == "Log.entryAdded":
            wrong.append(f"console: {parameters['entry']['text']} {parameters['entry'].get('url', '')}")
        elif method == "Network.requestWillBeSent":
            asked = parameters["request"]["url"]
            if urlsplit(asked).netloc not in (host, "") and not asked.startswith("data:"):
                wrong.append(f"another host: {asked}")
    seen = json.loads(browser.evaluate(SEEN))
    wrong += [f"the picture {image} is not shown" for image in seen["images"]]
    wrong += [f"not set: {text}" for text in seen["unset"]]
    wrong += [f"hard to read, contrast {text}" for text in seen["faint"]]
    if seen["width"] > VIEWS[view]:
        wrong.append(f"the page is {seen['width']} pixels wide")
    return wrong, seen


def follow(pages, book):
    """Links that lead nowhere: pages has links and marks by name, and book is the folder of all files."""
    for name, seen in pages.items():
        for link in seen["links"]:
            parts = urlsplit(urljoin(f"http://book/{name}", link))
            if parts.netloc != "book" or parts.scheme != "http":
                continue
            target = unquote(parts.path).lstrip("/") or "index.html"
            if not (book / target).exists():
                yield f"{name}: no page {target}"
            elif target in pages and parts.fragment and unquote(parts.fragment) not in pages[target]["ids"]:
                yield f"{name}: no place #{parts.fragment} in {target}"


def searched(browser, address):
    """Whether the search finds the page on a word."""
    browser.open(f"{address}/introduction.html?search=saltation", VIEWS["light"])
    end = time.monotonic() + 20
    while time.monotonic() < end:
        found = browser.evaluate("[...document.querySelectorAll('#mdbook-searchresults a, #searchresults a')].map(a => a.getAttribute('href')).join(' ')")
        if "histories.html" in found:
            return []
        time.sleep(0.2)
    return [f"the search for 'saltation' finds {found or 'nothing'}, not theory/histories"]


def serve(folder):
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=str(folder)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    return f"http://127.0.0.1:{server.server_port}"


def main(arguments):
    if len(arguments) != 2 or not (Path(arguments[0]) / "introduction.html").is_file():
        print("usage: python book.py BOOK SCREENSHOTS, where BOOK is a folder that mdbook wrote", file=sys.stderr)
        return 2
    book, pictures = Path(arguments[0]), Path(arguments[1])
    pictures.mkdir(parents=True, exist_ok=True)
    # The whole book on one page, for printing, repeats the others.
    names = sorted(str(p.relative_to(book)) for p in book.rglob("*.html") if p.name not in ("print.html", "404.html", "toc.html"))
    wrong, pages, formulas = [], {}, 0
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        browser = Browser(f"{folder}/profile")
        try:
            (Path(folder) / "faults.html").write_text(FAULTS, encoding="utf-8")
            found, seen = look(browser, serve(folder), "faults.html", "light")
            found += follow({"faults.html": seen}, Path(folder))
            wrong += [f"the planted fault '{part}' was not found in {found}" for part in PLANTED if not any(part in line for line in found)]
            address = serve(book)
            for view in VIEWS:
                for name in names:
                    found, seen = look(browser, address, name, view)
                    wrong += [f"{name}, {view}, {VIEWS[view]} pixels: {line}" for line in found]
                    pages[name] = seen
                    formulas += seen["formulas"]
                    if name.removesuffix(".html") in PICTURES:
                        browser.screenshot().save(pictures / f"{name.removesuffix('.html').replace('/', '-')}-{view}-{VIEWS[view]}.png")
            wrong += follow(pages, book)
            wrong += searched(browser, address)
        finally:
            browser.close()
    links = sum(len(seen["links"]) for seen in pages.values())
    print(f"{len(names)} pages in {len(VIEWS)} views, {links} links, {formulas // len(VIEWS)} formulas; {pictures}")
    for line in wrong:
        print(f"FAILED: {line}")
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
