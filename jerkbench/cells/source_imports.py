"""The imports of a Python file, read without running it."""

import ast
from collections.abc import Iterator
from pathlib import Path


def imported_names(path: Path) -> set[str]:
    """Return the modules that the file imports by name, also inside functions; not those of its own package."""
    return set(_imports(_parsed(path)))


def named_places(path: Path) -> set[str]:
    """Return the first part of every text in the file that may be the name of a file or a folder."""
    texts = (node.value for node in ast.walk(_parsed(path)) if isinstance(node, ast.Constant))
    return {text.split("/")[0] for text in texts if isinstance(text, str) and len(text) < 256}


def _imports(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield node.module
        elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith(("import_module", "__import__")):
            yield from (arg.value for arg in node.args[:1] if isinstance(arg, ast.Constant) and type(arg.value) is str)


def _parsed(path: Path) -> ast.Module:
    """The file's syntax; of one that is no Python, nothing."""
    try:
        return ast.parse(path.read_bytes())
    except (SyntaxError, ValueError):
        return ast.Module(body=[], type_ignores=[])
