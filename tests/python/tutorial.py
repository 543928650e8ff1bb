"""Runs the Python of Markdown pages, as a reader would: python tutorial.py [--shell] PAGE...

The blocks of a page are one program, run in an empty folder that has the files which the page saves (<!-- file: NAME -->). A block that
marks a test for pytest is run by pytest as well. With --shell the commands of the page are run first.
"""

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

BLOCK = re.compile(r"(?:<!-- file: (?P<file>\S+) -->\n)?```(?P<language>\w+)\n(?P<text>.*?)^```$", re.DOTALL | re.MULTILINE)


def main(pages):
    failed = False
    with_shell = pages[0] == "--shell"
    pages = pages[with_shell:]
    for page in [Path(page).resolve() for page in pages]:
        text = page.read_text(encoding="utf-8")
        blocks = list(BLOCK.finditer(text))
        program = ""
        for block in blocks:
            if block["language"] == "python":
                # On the lines that it has in the page, for what is said of errors.
                program += "\n" * (text.count("\n", 0, block.start("text")) - program.count("\n")) + block["text"]
        assert program or with_shell, f"{page} has no Python"
        with tempfile.TemporaryDirectory() as folder:
            os.chdir(folder)
            for block in blocks:
                if block["file"] and block["language"] == "toml":
                    Path(block["file"]).parent.mkdir(parents=True, exist_ok=True)
                    Path(block["file"]).write_text(block["text"], encoding="utf-8")
            for block in blocks:
                if with_shell and block["language"] == "sh":
                    subprocess.run(["sh", "-e"], input=block["text"], text=True, check=True)
            Path("test_page.py").write_text(program, encoding="utf-8")
            sys.path.insert(0, folder)
            exec(compile(program, str(page), "exec"), {"__name__": "page"})
            if "def test_" in program:
                failed |= subprocess.run([sys.executable, "-m", "pytest", "--quiet", "test_page.py"], check=False).returncode != 0
            sys.path.remove(folder)
            os.chdir("/")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
