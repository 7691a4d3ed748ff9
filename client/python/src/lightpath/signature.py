"""Options as real parameters: what `help()`, completion and `inspect.signature` show of functions with many options.

A function takes its options as `**options: Unpack[Options]`, which editors and type checkers understand. Python itself
shows only `**options`. The decorator gives the function the parameters, and their texts, of the class `Options`.
"""

from __future__ import annotations

import ast
import functools
import inspect
import sys
import textwrap
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

Function = TypeVar("Function", bound="Callable[..., Any]")

_WIDTH = 100


class _Default:
    """Stands for the value that counts if an option is not given."""

    def __repr__(self) -> str:
        return "<default>"


_DEFAULT = _Default()


def with_options(options: type[Any], *, required: tuple[str, ...] = ()) -> Callable[[Function], Function]:
    """Show the options of a `TypedDict` as keyword parameters of a function, and describe them in its docstring."""

    def decorate(function: Function) -> Function:
        signature = inspect.signature(function)
        own = [each for each in signature.parameters.values() if each.kind is not inspect.Parameter.VAR_KEYWORD]
        added = [
            inspect.Parameter(
                name,
                inspect.Parameter.KEYWORD_ONLY,
                default=inspect.Parameter.empty if name in required else _DEFAULT,
                annotation=_type_text(annotation),
            )
            for name, annotation in options.__annotations__.items()
            if name not in signature.parameters
        ]
        function.__signature__ = signature.replace(parameters=[*own, *added])  # type: ignore[attr-defined]
        listed = describe(options, [each.name for each in added])
        function.__doc__ = f"{inspect.cleandoc(function.__doc__ or '')}\n\nOptions:\n\n{listed}"
        return function

    return decorate


def describe(options: type[Any], names: list[str]) -> str:
    """Return a list of options with the texts that stand below them in their class or in those that it extends."""
    of_module = _texts(options.__module__)
    # Classes of options extend those that stand above them in the same module.
    texts = {name: text for each in of_module.values() for name, text in each.items()}
    texts |= of_module.get(options.__name__, {})
    lines = [f"- `{name}`: {texts[name]}" if name in texts else f"- `{name}`" for name in names]
    return "\n".join(textwrap.fill(line, _WIDTH, subsequent_indent="  ") for line in lines)


def _type_text(annotation: Any) -> Any:
    return getattr(annotation, "__forward_arg__", annotation)


@functools.cache
def _texts(module: str) -> Mapping[str, Mapping[str, str]]:
    """Return the texts below the attributes of each class of a module; nothing without its source."""
    try:
        tree = ast.parse(inspect.getsource(sys.modules[module]))
    except (OSError, TypeError):
        return {}
    return {each.name: _texts_of(each) for each in tree.body if isinstance(each, ast.ClassDef)}


def _texts_of(each: ast.ClassDef) -> Mapping[str, str]:
    found = {}
    for attribute, text in zip(each.body, each.body[1:], strict=False):
        named = isinstance(attribute, ast.AnnAssign) and isinstance(attribute.target, ast.Name)
        if named and isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant):
            found[attribute.target.id] = " ".join(str(text.value.value).split())  # type: ignore[attr-defined]
    return found
