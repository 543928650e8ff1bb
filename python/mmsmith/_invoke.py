"""Calls of the commands of `mms`: keywords become options, messages come back in the words of Python."""

import difflib
import functools
import inspect
import json
import os
import re
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec, TypeAlias, TypeVar

from mmsmith import _mmsmith
from mmsmith._progress import watcher
from mmsmith._results import Result

if TYPE_CHECKING:
    from mmsmith._solution import Solution

#: A solution that was loaded, a name, or the path of a specification.
Named: TypeAlias = "str | os.PathLike[str] | Solution"
#: What is told of long work: a function of the share that is done and of the case under way, or whether a line on standard error is.
Progress: TypeAlias = Callable[[float, str], object] | bool | None

P = ParamSpec("P")
R = TypeVar("R")
AnyResult = TypeVar("AnyResult", bound=Result)

#: The parameters of functions that are no options.
POSITIONAL = ("solution", "solutions", "files")


def named(function: Callable[P, R]) -> Callable[P, R]:
    """The function, which names the nearest keyword where it is given one that it does not have."""
    keywords = [name for name, parameter in inspect.signature(function).parameters.items() if parameter.kind is parameter.KEYWORD_ONLY]

    @functools.wraps(function)
    def call(*words: P.args, **options: P.kwargs) -> R:
        for name in options.keys() - set(keywords):
            raise TypeError(unexpected(f"{function.__name__}()", name, keywords))
        return function(*words, **options)

    return call


def unexpected(what: str, name: str, known: Sequence[str]) -> str:
    """The message on a keyword that does not exist."""
    near = difflib.get_close_matches(name, known, n=1)
    tip = f"did you mean '{near[0]}'?" if near else f"there are: {', '.join(known)}"
    return f"{what} has no keyword '{name}'; {tip}"


def invoke(kind: type[AnyResult], name: str, words: Sequence[Named], options: Mapping[str, Any]) -> AnyResult:
    """The result of a command; what a function was called with stands for its options."""
    given = {key: value for key, value in options.items() if key not in POSITIONAL and key != "progress"}
    document, passed = _perform(name, words, given, options.get("progress"))
    return kind(document, passed)


def command(name: str, *words: Named, progress: Progress = None, **options: Any) -> Result:
    """The command `mms NAME` with these words and options; gives the JSON that it writes, and prints nothing.

    A solution that was loaded stands for its name with its parameters. `cells=32` is `--cells 32`, `cells=[8, 16]` is `--cells 8,16`,
    `set={"A": 0.05}` is `--set A=0.05`, `fast_math=True` is `--fast-math`; False and None leave an option out. A command that writes
    no JSON, such as `gen`, gives an empty result. Raises `Error` with the message of `mms`, and KeyboardInterrupt after Ctrl-C.
    """
    return Result(*_perform(name, words, options, progress))


def _perform(name: str, words: Sequence[Named], options: Mapping[str, Any], progress: Progress) -> tuple[dict[str, Any], bool]:
    from mmsmith._commands import WITH_JSON

    line = ["mms", name]
    for word in words:
        line += [os.fspath(word)] if isinstance(word, (str, os.PathLike)) else word._words(name)
    for key, value in options.items():
        line += _option("--" + key.replace("_", "-"), value)
    with tempfile.TemporaryDirectory() as folder, watcher(progress) as watch:
        path = Path(options["json"]) if options.get("json") else Path(folder) / "result.json"
        if name in WITH_JSON and not options.get("json"):
            line += ["--json", str(path)]
        try:
            passed = _mmsmith.call(line, watch)
        except _mmsmith.Error as error:
            raise type(error)(in_python(str(error))) from None
        document: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
        return document, passed


def _option(name: str, value: Any) -> list[str]:
    if value is None or value is False:
        return []
    if value is True:
        return [name]
    if isinstance(value, Mapping):
        entries = [f"{key}={_text(entry)}" for key, entry in value.items()]
        # Orders are one value, as in u=2,v=1.
        return [f"{name}={','.join(entries)}"] if name == "--expect" else [f"{name}={entry}" for entry in entries]
    return [f"{name}={_text(value)}"]


def _text(value: Any) -> str:
    if isinstance(value, (str, os.PathLike)):
        return os.fspath(value)
    if hasattr(value, "__iter__"):
        return ",".join(_text(entry) for entry in value)
    # As Python writes the number, also where it is one of NumPy's.
    return repr(value.item() if hasattr(value, "item") else value)


#: An option in a message, with the placeholder of its value, or with a value that is a number, a list of numbers, or an assignment.
OPTION = re.compile(r"(?<!\w)'?--(?P<name>[a-z][a-z0-9-]*)(?:[ =](?:<[^>]*>|(?P<value>[A-Za-z0-9_.]+=[-+0-9.e]+|[-+0-9.e]+(?:,[-+0-9.e]+)*)))?'?")


def in_python(message: str) -> str:
    """A message of `mms` with keywords in place of options, and without the usage of the command line."""
    kept = re.split(r"\n\s*\n(?=Usage:|For more information|  tip: to pass)", message)[0]
    return OPTION.sub(_keyword, kept).rstrip()


def _keyword(found: re.Match[str]) -> str:
    name, value = found["name"].replace("-", "_"), found["value"]
    # A full stop or a comma ends the sentence, not the number.
    end = "" if value is None else value[len(value.rstrip(".,")) :]
    value = None if value is None else value.rstrip(".,")
    if not value:
        return f"'{name}'{end}" if found[0].startswith("'") else f"{name}{end}"
    key, equals, number = value.partition("=")
    if equals:
        return f'{name}={{"{key}": {number}}}{end}'
    return f"{name}=[{value.replace(',', ', ')}]{end}" if "," in value else f"{name}={value}{end}"
