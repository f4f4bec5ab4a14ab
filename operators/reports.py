"""Reports of operators: errors and warnings as sentences."""

from __future__ import annotations

from collections.abc import Iterable

import bpy

from ..rosy_addon.errors import as_sentence, error_text


def report_error(operator: bpy.types.Operator, error: Exception) -> set[str]:
    """Report one of `REPORTED_ERRORS`. Return the result of an operator that has failed."""
    operator.report({"ERROR"}, as_sentence(error_text(error)))
    return {"CANCELLED"}


def report_operator_error(operator: bpy.types.Operator, error: RuntimeError) -> set[str]:
    """Report the error of another operator that was called. Return the result of one that has failed."""
    operator.report({"ERROR"}, str(error).strip().removeprefix("Error: "))
    return {"CANCELLED"}


def report_warning(operator: bpy.types.Operator, message: str) -> None:
    """Report what the user should know about a result."""
    operator.report({"WARNING"}, as_sentence(message))


def report_warnings(operator: bpy.types.Operator, messages: Iterable[str]) -> None:
    """Report each of several messages once."""
    for message in dict.fromkeys(messages):
        report_warning(operator, message)
