"""The provenance of a result, besides its configuration: our own code, the plugins' code, the libraries."""

import hashlib
import platform
import secrets
import subprocess
import sys
from functools import cache
from importlib.metadata import version
from pathlib import Path

from jerkbench.cells.plugin_sources import KNOWN, sources_digest

PACKAGE = Path(__file__).parents[1]
LIBRARIES = ("filterpy", "numba", "numpy", "scipy", "pandas", "pymap3d", "hydra-core")
NOT_COMPUTING = ("fetching", "inspection", "cli", "data", "report", "verbs")
"""Parts of the package that no number depends on."""


@cache
def code_digest() -> str:
    """Hash of every source file of this package, and of every trace, that a result may depend on."""
    digest = hashlib.sha256()
    for path in sorted([*PACKAGE.rglob("*.py"), *PACKAGE.glob("traces/shipped/*.parquet")]):
        inside = path.relative_to(PACKAGE)
        if inside.parts[0].removesuffix(".py") not in NOT_COMPUTING:
            digest.update(str(inside).encode() + path.read_bytes())
    return digest.hexdigest()


@cache
def plugin_digest(cls: type) -> str:
    """Hash of all that a plugin outside this package depends on, and that of its bases.

    Empty for our own plugins, which `code_digest` covers. A class without a file, of an interactive session, has
    another one in each process: nothing tells whether it changed.
    """
    homes = {c.__module__.partition(".")[0] for c in cls.__mro__} - KNOWN - sys.stdlib_module_names
    try:
        return hashlib.sha256("".join(map(sources_digest, sorted(homes))).encode()).hexdigest() if homes else ""
    except LookupError:
        return _this_process()


@cache
def _this_process() -> str:
    return secrets.token_hex(32)


@cache
def versions() -> dict[str, str]:
    """Versions of Python, this package and the libraries that compute."""
    return {"python": platform.python_version(), **{name: version(name) for name in ("jerkbench", *LIBRARIES)}}


@cache
def git_commit() -> str:
    """The commit of the checkout that the package runs from, with "+changes" if it has any; empty outside one."""

    def git(*words: str) -> str:
        done = subprocess.run(["git", "-C", str(PACKAGE), *words], capture_output=True, text=True, check=False)  # noqa: S603, S607 - fixed words
        return done.stdout.strip() if done.returncode == 0 else ""

    try:
        tracked = git("ls-files", "--", "__init__.py")
        commit = git("rev-parse", "HEAD") if tracked else ""
        return commit + ("+changes" if commit and git("status", "--porcelain") else "")
    except FileNotFoundError:  # no git on this machine
        return ""
