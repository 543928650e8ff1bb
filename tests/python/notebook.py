"""Turns a page of the book into a notebook, and runs notebooks: python notebook.py --write | --check | --run PAGE...

A notebook lies beside its page: guide/python.ipynb of guide/python.md. Prose becomes cells of text, blocks in Python become cells of code, and
files that the page saves become cells that write them. Other blocks stay text. --check fails where a notebook is not what its page gives;
--run executes the cells in order, in an empty folder, and fails at the first error. It needs nbclient and ipykernel.
"""

import json
import re
import sys
import tempfile
from pathlib import Path

FENCE = re.compile(r"(?P<marks>(?:<!--[^>]*-->\n)*)```(?P<language>\w+)\n(?P<text>.*?)^```$\n?", re.DOTALL | re.MULTILINE)


def cells(page):
    """Text and code of a page, in order."""
    at = 0
    for block in FENCE.finditer(page):
        name = re.search(r"<!-- file: (\S+) -->", block["marks"])
        if block["language"] != "python" and not name:
            continue
        yield "markdown", page[at : block.start()]
        yield "code", f"%%writefile {name[1]}\n{block['text']}" if name else block["text"]
        at = block.end()
    yield "markdown", page[at:]


def notebook(path):
    """The notebook of a page, as text."""
    page = re.sub(r"<!--.*?-->\n?", lambda mark: mark[0] if "file:" in mark[0] else "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    # A cell of text is alone: links to other pages lead to the built book beside the notebook.
    page = re.sub(r"\]\(([\w./-]+)\.md", r"](\1.html", page)
    found = []
    for kind, text in cells(page):
        text = text.strip("\n")
        if text:
            cell = {"cell_type": kind, "id": f"cell-{len(found)}", "metadata": {}, "source": text.splitlines(keepends=True)}
            if kind == "code":
                cell |= {"execution_count": None, "outputs": []}
            found.append(cell)
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    whole = {"cells": found, "metadata": {"kernelspec": kernel, "language_info": {"name": "python"}}, "nbformat": 4, "nbformat_minor": 5}
    return json.dumps(whole, indent=1, ensure_ascii=False) + "\n"


def run(path):
    import nbclient
    import nbformat

    with tempfile.TemporaryDirectory() as folder:
        nbclient.NotebookClient(nbformat.read(path, as_version=4), timeout=600, resources={"metadata": {"path": folder}}).execute()


def main(action, *pages):
    failed = False
    for page in map(Path, pages):
        path = page.with_suffix(".ipynb")
        if action == "--write":
            path.write_text(notebook(page), encoding="utf-8")
        elif not path.exists() or path.read_text(encoding="utf-8") != notebook(page):
            print(f"{path} is not what {page.name} gives: python tests/python/notebook.py --write {page}")
            failed = True
        elif action == "--run":
            run(path)
            print(f"{path}: every cell runs")
    return failed


if __name__ == "__main__":
    if len(sys.argv) < 3 or sys.argv[1] not in ("--write", "--check", "--run"):
        sys.exit(__doc__)
    sys.exit(main(*sys.argv[1:]))
