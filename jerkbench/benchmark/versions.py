"""What a result depends on besides its configuration: our own code, the plugins' code, the libraries."""

import hashlib
import inspect
import platform
import subprocess
from functools import cache
from importlib.metadata import version
from pathlib import Path

PACKAGE = Path(__file__).parents[1]
LIBRARIES = ("filterpy", "numba", "numpy", "scipy", "pandas", "pymap3d", "hydra-core")
NOT_COMPUTING = ("fetching", "inspection", "cli", "data", "report", "verbs")
"""Parts of the package that no number depends on."""


@cache
def code_digest() -> str:
    """Hash of every source file of this package that a result may depend on."""
    digest = hashlib.sha256()
    for path in sorted(PACKAGE.rglob("*.py")):
        inside = path.relative_to(PACKAGE)
        if inside.parts[0].removesuffix(".py") not in NOT_COMPUTING:
            digest.update(str(inside).encode() + path.read_bytes())
    return digest.hexdigest()


@cache
def plugin_digest(cls: type) -> str:
    """Hash of the code of a plugin outside this package: its package, or its module, and those of its bases.

    Empty for our own plugins, which `code_digest` covers.
    """
    foreign = [c for c in cls.__mro__ if c.__module__.partition(".")[0] not in ("jerkbench", "builtins")]
    digest = hashlib.sha256()
    for path in sorted({path for c in foreign for path in _sources(c)}):
        digest.update(path.read_bytes())
    return digest.hexdigest() if foreign else ""


def _sources(cls: type) -> list[Path]:
    """Every Python file of the class's package; of a module that stands alone, its file."""
    try:
        source = inspect.getsourcefile(cls)
    except TypeError:  # defined in an interactive session: there is no file
        return []
    if source is None:
        return []
    levels = cls.__module__.count(".") + Path(source).stem.count("__init__")
    return sorted(Path(source).parents[levels - 1].rglob("*.py")) if levels else [Path(source)]


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
