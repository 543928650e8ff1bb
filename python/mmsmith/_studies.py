"""The commands of `mms` as functions: a keyword is an option, a dict is the command's JSON."""

import json
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from mmsmith import _mmsmith

if TYPE_CHECKING:
    from mmsmith._solution import Solution

    Named: TypeAlias = str | os.PathLike[str] | Solution


def command(name: str, *words: "Named", **options: Any) -> dict[str, Any]:
    """The command `mms NAME` with these words and options; gives the JSON that it writes, and prints nothing.

    A solution that was loaded stands for its name with its parameters. `cells=32` is `--cells 32`, `cells=[8, 16]` is `--cells 8,16`,
    `set={"A": 0.05}` is `--set A=0.05`, `fast_math=True` is `--fast-math`; False and None leave an option out. Raises `Error` with the
    message of `mms`, and KeyboardInterrupt after Ctrl-C.
    """
    line = ["mms", name]
    for word in words:
        line += [os.fspath(word)] if isinstance(word, (str, os.PathLike)) else word._words()
    for key, value in options.items():
        line += _option("--" + key.replace("_", "-"), value)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(options["json"]) if options.get("json") else Path(folder) / "result.json"
        _mmsmith.call(line if options.get("json") else [*line, "--json", str(path)])
        result: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        return result


def _option(name: str, value: Any) -> list[str]:
    if value is None or value is False:
        return []
    if value is True:
        return [name]
    if isinstance(value, Mapping):
        return [f"{name}={key}={_text(entry)}" for key, entry in value.items()]
    return [f"{name}={_text(value)}"]


def _text(value: Any) -> str:
    if isinstance(value, (str, os.PathLike)):
        return os.fspath(value)
    if hasattr(value, "__iter__"):
        return ",".join(_text(entry) for entry in value)
    # As Python writes the number, also where it is one of NumPy's.
    return repr(value.item() if hasattr(value, "item") else value)


def run(solution: "Named", /, **options: Any) -> dict[str, Any]:
    """`mms run`: one simulation and its errors."""
    return command("run", solution, **options)


def converge(solution: "Named", /, **options: Any) -> dict[str, Any]:
    """`mms converge`: orders of accuracy over grids or time steps."""
    return command("converge", solution, **options)


def stability(solution: "Named", /, **options: Any) -> dict[str, Any]:
    """`mms stability`: the largest stable CFL number."""
    return command("stability", solution, **options)


def tradeoff(solution: "Named", /, **options: Any) -> dict[str, Any]:
    """`mms tradeoff`: error against cost over all schemes that fit."""
    return command("tradeoff", solution, **options)


def score(solution: "Named", /, *files: str | os.PathLike[str], **options: Any) -> dict[str, Any]:
    """`mms score`: errors and orders of what another solver wrote."""
    return command("score", solution, *files, **options)
