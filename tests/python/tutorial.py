"""Runs the Python of Markdown pages, as a reader would: python tutorial.py PAGE...

The blocks of a page are one program, run in an empty folder that has the files which the page saves (<!-- file: NAME -->). A block that
marks a test for pytest is run by pytest as well.
"""

import os
import re
import sys
import tempfile
from pathlib import Path

import pytest

BLOCK = re.compile(r"(?:<!-- file: (?P<file>\S+) -->\n)?```(?P<language>\w+)\n(?P<text>.*?)^```$", re.DOTALL | re.MULTILINE)


def main(pages):
    failed = False
    for page in map(Path.resolve, map(Path, pages)):
        blocks = list(BLOCK.finditer(page.read_text(encoding="utf-8")))
        program = "\n".join(block["text"] for block in blocks if block["language"] == "python")
        assert program, f"{page} has no Python"
        with tempfile.TemporaryDirectory() as folder:
            os.chdir(folder)
            for block in blocks:
                if block["file"] and block["language"] == "toml":
                    Path(block["file"]).parent.mkdir(parents=True, exist_ok=True)
                    Path(block["file"]).write_text(block["text"], encoding="utf-8")
            Path("test_page.py").write_text(program, encoding="utf-8")
            exec(compile(program, str(page), "exec"), {"__name__": "page"})
            if "def test_" in program:
                failed |= pytest.main(["-q", "test_page.py"]) != 0
            os.chdir("/")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
