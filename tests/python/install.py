"""Installs the Python package around a library that is already built, as `pip install ./python` lays it out.

    PYTHON install.py LIBRARY

For the Python that runs it. CI builds the library once, with the tests; maturin would compile everything below it again. Its own wheel
is made in .ci/long.
"""

import os
import shutil
import sys
import sysconfig
import tomllib
from pathlib import Path

library = Path(sys.argv[1])
package = Path(__file__).resolve().parents[2] / "python"
project = tomllib.loads((package / "pyproject.toml").read_text())["project"]
version = tomllib.loads((package.parent / "Cargo.toml").read_text())["workspace"]["package"]["version"]
name = project["name"]
site = Path(sysconfig.get_path("purelib"))

for old in [site / name, *site.glob(f"{name}-*.dist-info")]:
    shutil.rmtree(old, ignore_errors=True)
shutil.copytree(package / name, site / name, ignore=shutil.ignore_patterns("__pycache__", "*.so"))
shutil.copy(library, site / name / f"_{name}.abi3.so")

information = site / f"{name}-{version}.dist-info"
information.mkdir()
(information / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
groups = {"console_scripts": project["scripts"], **project["entry-points"]}
lines = [line for group, entries in groups.items() for line in [f"[{group}]", *(f"{key} = {value}" for key, value in entries.items())]]
(information / "entry_points.txt").write_text("\n".join(lines) + "\n")
scripts = [Path(sysconfig.get_path("scripts")) / script for script in project["scripts"]]
for path, place in zip(scripts, project["scripts"].values()):
    module, function = place.split(":")
    path.write_text(f"#!{sys.executable}\nimport sys\n\nfrom {module} import {function}\n\nsys.exit({function}())\n")
    path.chmod(0o755)

# Without the list of its files pip cannot put another build in the place of this one.
record = information / "RECORD"
record.touch()
files = [path for folder in [site / name, information] for path in sorted(folder.rglob("*")) if path.is_file()]
record.write_text("".join(f"{os.path.relpath(path, site)},,\n" for path in files + scripts))
