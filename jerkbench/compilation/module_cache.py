"""Compiled code on the disk: what is kept, what is believed of it, and what is loaded."""

import gc
import hashlib
import os
import pickle
import platform
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from itertools import takewhile
from pathlib import Path
from tempfile import TemporaryDirectory, gettempdir
from threading import RLock
from types import ModuleType
from typing import Any, Final

from filelock import FileLock, Timeout

from jerkbench.compilation.code_digest import unknown_part
from jerkbench.files import Distrusted, cache_folder, read_trusted, write_trusted
from jerkbench.notices import notify

Files = Mapping[str, bytes]
"""What numba wrote for an entry point, and its text: content by name."""


def read_kept(path: Path, name: str, source: str) -> Files | None:
    """Return what `write_kept` kept at ``path``, or None where there is nothing to read. Loading it means running it.

    Args:
        path: the file.
        name: of the entry point's module.
        source: its text.

    Raises:
        Distrusted: as `jerkbench.files.read_trusted` says, or it is another entry point's.
    """
    content = read_trusted(path)
    if content is None:
        return None
    files: Files = pickle.loads(content)  # noqa: S301 - only this user can have written it
    if files.get(f"{name}.py") != source.encode():
        raise Distrusted("it belongs to something else")
    return files


def write_kept(path: Path, files: Files) -> None:
    """Keep ``files`` at ``path``.

    Raises:
        OSError: nothing can be written there.
    """
    write_trusted(path, pickle.dumps(dict(files)))


# Entry points: small generated modules, real files, because numba keeps on disk only what comes from a file.

Namespace = Callable[[str], Mapping[str, Any]]

_LOADING = RLock()
"""A module that another thread is still loading would look finished."""


BEFORE_WAITING: Final[list[Callable[[], None]]] = []
"""Called before this process waits for another one that is compiling the same."""

LOOPS = "JERKBENCH_LOOPS"
"""Environment variable: the compiled loops that a sweep needs, as `jerkbench.engines.compiled_engine` writes them."""

COMPILED = "compiled"
"""The kind of cache that holds compiled code."""

PROCESSOR_LEVELS = {
    "x86-64-v3": {"avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe"},
    "x86-64-v4": {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"},
}
"""The kinds of processor that machine code is made for, and the instructions that each needs besides those of the one
before: https://gitlab.com/x86-psABIs/x86-64-ABI. Code made for one model alone is not faster."""


def can_compile() -> bool:
    """Whether numba compiles anything: with NUMBA_DISABLE_JIT=1 in the environment it does not."""
    from numba import config

    return not config.DISABLE_JIT


def load_entry(title: str, source: str, key: str, namespace: Namespace) -> ModuleType:
    """Import the entry point ``source``; it compiles what it defines, or finds it compiled on the disk.

    Args:
        title: what is compiled, for the line that says so.
        source: text of the module, which defines ``entry``. Together with ``key`` it names the file.
        key: digest of everything that the entry point calls.
        namespace: given the module's name, the values that stand in the module before its first line.
    """
    name = _module_name(title, source, key)
    with _LOADING:
        if name in sys.modules:
            return sys.modules[name]
        if reason := unknown_part(key):
            notify(f"compiling {title} in each process anew: nothing tells whether {reason}, which it uses, changed")
            return _imported(name, {f"{name}.py": source.encode()}, namespace)[0]
        path = _path(name)
        if (files := _kept(path, title, source)) is None:
            return _compiled(path, title, source, namespace)
        return _imported(name, files, namespace)[0]


def is_kept(title: str, source: str, key: str) -> bool:
    """Whether `load_entry` would find the entry point on the disk, compiled."""
    path = _path(_module_name(title, source, key))
    return _kept(path, title, source) is not None


def _path(name: str) -> Path:
    return cache_folder(COMPILED) / f"{name}.compiled"


def _kept(path: Path, title: str, source: str) -> Files | None:
    """What is in the cache, compiled; nothing where it cannot be believed."""
    try:
        return read_kept(path, path.stem, source)
    except Distrusted as reason:
        notify(f"what is kept of {title} in {path} is not used, it is compiled anew: {reason}")
        return None


def _compiled(path: Path, title: str, source: str, namespace: Namespace) -> ModuleType:
    """Compile what is not on the disk, and keep it; another process may do so meanwhile."""
    name = path.stem
    with _alone(path, title) as keeps:
        files = _kept(path, title, source)
        if files is not None:
            return _imported(name, files, namespace)[0]
        if keeps:
            notify(f"Compiling {title}. Needed once; a few seconds.", title)
        module, files = _imported(name, {f"{name}.py": source.encode()}, namespace)
        if keeps and files:
            _keep(path, files)
        return module


def _keep(path: Path, files: Files) -> None:
    try:
        write_kept(path, files)
    except OSError as error:
        _cannot_keep(path.parent, error)


def _cannot_keep(folder: Path, error: OSError) -> None:
    """Say it once, not for each entry point."""
    notify(
        f"compiled code cannot be kept in {folder} ({error.strerror}), so each process compiles anew; name a"
        " that can be written in the environment variable JERKBENCH_CACHE",
        "cannot keep",
    )


@contextmanager
def _alone(path: Path, title: str) -> Iterator[bool]:
    """Of several processes that start together let one compile, and keep it; where there can be no lock, each does."""
    lock = FileLock(path.with_suffix(".lock"))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        lock.acquire(timeout=0)
    except Timeout:
        for call in tuple(BEFORE_WAITING):
            call()
        notify(f"waiting for {title}, which another process is compiling", title)
        lock.acquire()
    except OSError as error:
        _cannot_keep(path.parent, error)
    try:
        yield lock.is_locked
    finally:
        lock.release()


@contextmanager
def _uncollected() -> Iterator[None]:
    """Look for no cyclic garbage: a compilation keeps most of its objects, and the search was a seventh of its time."""
    before = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if before:
            gc.enable()


@contextmanager
def _settings() -> Iterator[None]:
    """Let LLVM join like operations of straight code into vectors; let numba write beside the text, nowhere else."""
    from numba import config

    ours = {"SLP_VECTORIZE": 1, "CACHE_DIR": "", "CACHE_LOCATOR_CLASSES": ""}
    before = {name: getattr(config, name) for name in ours if hasattr(config, name)}
    for name in before:
        setattr(config, name, ours[name])
    try:
        yield
    finally:
        for name, value in before.items():
            setattr(config, name, value)


def _module_name(title: str, source: str, key: str) -> str:
    import numba

    python = ".".join(platform.python_version_tuple()[:2])
    versions = f"{numba.__version__} {python} {target()!r} {_own_digest()}"
    digest = hashlib.sha256(f"{versions} {key} {source}".encode()).hexdigest()[:16]
    return f"jerkbench_{''.join(c if c.isalnum() else '_' for c in title)}_{digest}"


@cache
def target() -> tuple[str, str, str]:
    """Return what numba makes machine code for: system, processor, and its features.

    It is a level that many models have, unless the environment names another, or numba has made something already.
    """
    from numba import config
    from numba.core.registry import cpu_target

    free = (
        config.CPU_NAME is None and config.CPU_FEATURES is None and "_toplevel_target_context" not in vars(cpu_target)
    )
    if free and (level := level_of_processor()):
        config.CPU_NAME, config.CPU_FEATURES = level, ""
    return cpu_target.target_context.codegen().magic_tuple()  # type: ignore[no-any-return]  # numba has no types


def level_of_processor() -> str | None:
    """Return the best of `PROCESSOR_LEVELS` that this processor has."""
    from llvmlite import binding

    there = {name for name, has_it in binding.get_host_cpu_features().items() if has_it}
    usable = list(takewhile(lambda level: PROCESSOR_LEVELS[level] <= there, PROCESSOR_LEVELS))
    return usable[-1] if usable else None


@cache
def _own_digest() -> str:
    """Hash of this package: how something is compiled decides on the result as well."""
    sources = sorted(Path(__file__).parent.glob("*.py"))
    return hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()


def _set_environments(entry: Any) -> None:  # noqa: ANN401 - numba has no types
    """Let inner functions find what they hand to Python; numba does so for what it makes machine code of alone."""
    for compiled in entry.overloads.values():
        for environment in compiled._find_referenced_environments():  # noqa: SLF001 - as numba does when it loads one
            compiled.codegen.set_env(environment.env_name, environment)


def _imported(name: str, files: Files, namespace: Namespace) -> tuple[ModuleType, Files]:
    """Run an entry point; returns it with what there is to keep of it: nothing where no folder has room for it."""
    module = ModuleType(name)
    sys.modules[name] = module  # numba looks there when it loads compiled code
    try:
        with _settings(), _uncollected():
            try:
                return module, _run_in_folder(module, files, namespace)
            except OSError as error:
                _no_room(error)
                source = files[f"{name}.py"].replace(b"cache=True", b"cache=False")
                _run(module, source, f"<{name}>", namespace)  # it compiles what it defines, and nothing is kept
                return module, {}
    except BaseException:
        del sys.modules[name]
        raise


def _run_in_folder(module: ModuleType, files: Files, namespace: Namespace) -> Files:
    """Run it in a folder that nobody else can write to; returns what is there afterwards."""
    with TemporaryDirectory(prefix="jerkbench-") as folder:
        path = Path(folder) / f"{module.__name__}.py"
        _write_all(path.parent, files)
        os.utime(path, (0, 0))  # numba compares it
        _run(module, path.read_bytes(), str(path), namespace)
        return _read_all(path.parent)


def _run(module: ModuleType, source: bytes, file: str, namespace: Namespace) -> None:
    module.__dict__.update(namespace(module.__name__), __file__=file)
    exec(compile(source, file, "exec"), module.__dict__)  # noqa: S102 - our own text; an import would leave byte code
    _set_environments(module.entry)


def _no_room(error: OSError) -> None:
    notify(
        f"compiled code finds no room in {gettempdir()} ({error.strerror}), so each process compiles anew; name a"
        " folder with room in the environment variable TMPDIR",
        "no room",
    )


def _write_all(folder: Path, files: Files) -> None:
    for name, content in files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(content)


def _read_all(folder: Path) -> Files:
    paths = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}
