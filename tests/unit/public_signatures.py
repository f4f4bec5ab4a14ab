"""The signatures of the public functions, classes, methods and properties, as lines of text.

``python tests/unit/public_signatures.py`` renews ``tests/unit/api/signatures.txt``.
"""

from __future__ import annotations

import inspect
import sys
from functools import cached_property
from pathlib import Path
from types import ModuleType

FILE = Path(__file__).with_name("api") / "signatures.txt"

#: Special methods that users call by an operator, a function or a notebook.
SPECIAL = {"__init__", "__len__", "__array__"}


def signatures(module: ModuleType) -> str:
    """Return one entry for each public name of a module and each member of its classes."""
    entries: list[str] = []
    for name in public_names(module):
        item = getattr(module, name)
        if not inspect.isclass(item):
            entries.append(function_entry(name, item))
            continue
        bases = ", ".join(base.__name__ for base in item.__bases__)
        entries.append(f"class {name}({bases})")
        fields = inspect.get_annotations(item)
        entries += [
            f"{name}.{field}: {type_text(annotation)}" for field, annotation in fields.items()
        ]
        members = {key: value for key, value in vars(item).items() if key not in fields}
        for key, member in members.items():
            if key.startswith("_") and (key not in SPECIAL or fields):
                continue
            if isinstance(member, (property, cached_property)):
                getter = member.fget if isinstance(member, property) else member.func
                entries.append(f"{name}.{key}: {type_text(getter.__annotations__['return'])}")
            elif inspect.isfunction(member):
                entries.append(function_entry(f"{name}.{key}", member))
    return "\n".join(entries) + "\n"


def public_names(module: ModuleType) -> list[str]:
    """Return what a module imports for others, without its own modules."""
    return sorted(
        name
        for name, item in vars(module).items()
        if not (name.startswith("_") or inspect.ismodule(item))
    )


def type_text(annotation: object) -> str:
    """Return an annotation as it is written; some are evaluated, others are strings."""
    if isinstance(annotation, type):
        return annotation.__name__
    return "None" if annotation is None else getattr(annotation, "__forward_arg__", str(annotation))


def function_entry(name: str, function: object) -> str:
    """Return a function with one parameter a line, as long ones would be hard to read."""
    signature = inspect.signature(function)
    lines, is_keyword_only = [], False
    for parameter in signature.parameters.values():
        if parameter.kind is parameter.KEYWORD_ONLY and not is_keyword_only:
            lines.append("*")
            is_keyword_only = True
        # Annotations are strings, whose quotes `str(parameter)` would keep.
        text = str(parameter.replace(annotation=parameter.empty, default=parameter.empty))
        if parameter.annotation is not parameter.empty:
            text += f": {type_text(parameter.annotation)}"
        if parameter.default is not parameter.empty:
            text += f" = {parameter.default!r}"
        lines.append(text)
    result = signature.return_annotation
    arrow = "" if result is signature.empty else f" -> {type_text(result)}"
    if len(lines) <= 2 or len(", ".join(lines)) < 60:
        return f"{name}({', '.join(lines)}){arrow}"
    return "\n".join([f"{name}(", *(f"    {line}," for line in lines), f"){arrow}"])


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
    from rosy_addon import api

    FILE.write_text(signatures(api))
