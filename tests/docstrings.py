"""Reading of the package's docstrings: what each public function says it takes and returns."""

import ast
import importlib
import inspect
import re
from dataclasses import dataclass, is_dataclass
from pathlib import Path
from types import FunctionType

import altijax

PACKAGE = Path(altijax.__file__).parent

_ENTRY = re.compile(r"^(?P<name>\*?\w+(?:, \w+)*) : (?P<slot>.+)$")
_SHAPE = re.compile(r"^\((?P<sizes>[^()]*)\)(?: (?P<unit>.+))?$")


@dataclass(frozen=True)
class Entry:
    """One line ``name : slot`` of a section: `shape` is None where the slot is no array."""

    name: str
    slot: str
    optional: bool

    @property
    def shape(self) -> tuple[str, ...] | None:
        found = _SHAPE.match(self.slot)
        return None if found is None else tuple(s.strip() for s in found["sizes"].split(",") if s.strip())

    @property
    def batched(self) -> bool:
        return self.shape is not None and self.shape[:1] == ("...",)


def public_functions(module_name: str) -> list[FunctionType]:
    module = importlib.import_module(f"altijax.{module_name}")
    return [
        member
        for name, member in vars(module).items()
        if not name.startswith("_")
        and getattr(member, "__module__", None) == module.__name__
        and callable(member)
        and not inspect.isclass(member)
    ]


def public_records(module_name: str) -> list[type]:
    module = importlib.import_module(f"altijax.{module_name}")
    return [
        member
        for name, member in vars(module).items()
        if not name.startswith("_") and is_dataclass(member) and member.__module__ == module.__name__
    ]


def section(documented: object, title: str) -> list[Entry]:
    """Entries of one NumPy-style section; empty where there is none."""
    lines = inspect.cleandoc(documented.__doc__ or "").splitlines()
    try:
        start = lines.index(title) + 2
    except ValueError:
        return []
    entries = []
    for number, line in enumerate(lines[start:], start):
        if number + 1 < len(lines) and set(lines[number + 1]) == {"-"}:
            break
        found = _ENTRY.match(line)
        if found:
            slot = found["slot"]
            optional = slot.endswith(", optional")
            entries.append(Entry(found["name"], slot.removesuffix(", optional"), optional))
    return entries


def imports_of(path: Path) -> list[ast.Import | ast.ImportFrom]:
    return [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Import | ast.ImportFrom)]
