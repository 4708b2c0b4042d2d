"""What is wrong with a value that pydantic refuses, in the words of this project."""

from __future__ import annotations

from pydantic import ValidationError
from pydantic_core import ErrorDetails

_WORDS = {  # of pydantic's kinds of error; the names in braces are of its context
    "greater_than": "want more than {gt}",
    "greater_than_equal": "want at least {ge}",
    "less_than": "want less than {lt}",
    "less_than_equal": "want at most {le}",
    "finite_number": "want a finite number",
    "float_type": "want a number",
    "float_parsing": "want a number",
    "int_type": "want a whole number",
    "int_parsing": "want a whole number",
    "int_from_float": "want a whole number",
    "bool_type": "want true or false",
    "bool_parsing": "want true or false",
    "string_type": "want a text",
    "string_too_short": "want at least {min_length} characters",
    "string_too_long": "want at most {max_length} characters",
    "string_pattern_mismatch": "want a text of the form {pattern}",
    "literal_error": "want {expected}",
    "enum": "want {expected}",
    "too_short": "want {min_length} or more, got {actual_length}",
    "too_long": "want at most {max_length} items",
    "list_type": "want a list",
    "tuple_type": "want a list",
    "dict_type": "want a section of keys",
    "model_type": "want a section of keys",
    "model_attributes_type": "want a section of keys",
    "missing": "is missing",
    "none_required": "want null",
    "extra_forbidden": "no such key",
    "json_invalid": "not JSON",
}


def in_own_words(error: ErrorDetails) -> str:
    """Return what is wrong with a value that pydantic refuses, in the words of this project."""
    words = _WORDS.get(error["type"])
    if words is not None:
        return words.format(**error.get("ctx", {}))
    return error["msg"].removeprefix("Value error, ").replace("Input should be", "want")


def first_refusal(error: ValidationError) -> str:
    """Return the first key that is refused and what is wrong with its value, of a file of its own."""
    first = error.errors()[0]
    place = ".".join(map(str, first["loc"]))
    return f"{place}: {in_own_words(first)}" if place else in_own_words(first)
