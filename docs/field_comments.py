"""What mkdocstrings does beyond its defaults: the comment behind a field is its documentation, as in the sources."""

from __future__ import annotations

import re
from typing import Any

import griffe

_COMMENT = re.compile(r"\s# (?!noqa|type:|fmt:)(.+)$")


class FieldComments(griffe.Extension):
    """Makes a section `Attributes` of the comments behind a class's fields: their units, mostly."""

    def on_class_members(self, *, cls: griffe.Class, **_: Any) -> None:
        """Look at the fields of a class whose docstring has no such section."""
        if cls.docstring is None or "Attributes:" in cls.docstring.value:
            return
        lines = []
        for name, field in cls.attributes.items():
            if not name.startswith("_") and field.docstring is None and field.source:
                comment = _COMMENT.search(field.source)
                lines += [f"  {name}: {comment[1]}"] if comment else []
        if lines:
            before, raises, after = cls.docstring.value.partition("\n\nRaises:")
            cls.docstring.value = "\n".join((f"{before}\n\nAttributes:", *lines)) + raises + after
