"""Literal blocks (after ``::``) of docstrings as fenced blocks, for the reference that mkdocstrings makes."""

from docstring import as_markdown
from griffe import Extension, Object


class LiteralBlocks(Extension):
    """Rewrites each docstring before it is parsed."""

    def on_object(self, *, obj: Object, **_: object) -> None:
        """Fence the literal blocks."""
        if obj.docstring and "::\n" in obj.docstring.value:
            obj.docstring.value = as_markdown(obj.docstring.value)
