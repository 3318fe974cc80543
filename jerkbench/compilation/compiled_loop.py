"""A loop compiled for the types that its annotations name, from the disk where it was compiled before."""

import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from typing import Annotated, Any, Final, get_args, get_origin, get_type_hints

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.compilation.code_digest import digest
from jerkbench.compilation.module_cache import is_kept, load_entry, target

Loop = Callable[..., Any]
Constants = Mapping[str, Any]

_SOURCE = '''"""Made by jerkbench."""

from numba import njit


@njit(signature, cache=True, error_model="numpy", nogil=True)
def entry({names}):
    return loop({names})
'''


def compiled_loop(
    loop: Loop, title: str, constants: Constants | None = None, apart: tuple[str, ...] = (), *, kernel: bool = True
) -> Loop:
    """Return ``loop``, compiled.

    Its signature is exact, because only such a one is found on the disk by the next process. Each argument is a number,
    one of the arrays with a number of axes in `jerkbench.arrays`, or a named tuple of those.

    Args:
        loop: a plain function with annotations.
        title: what it is, for the line that says that it is compiled.
        constants: as for `jerkbench.compilation.jitted.jitted`, like the next two.
        apart: likewise.
        kernel: likewise.
    """

    def namespace(home: str) -> dict[str, Any]:
        from jerkbench.compilation.jitted import jitted  # it needs numba, for which a list of plugins does not wait

        inner = jitted(loop, home, constants, kernel=kernel, apart=apart)
        return {"loop": inner, "signature": signature_of(loop)}

    entry: Loop = load_entry(*_named(loop, title, constants, apart), namespace).entry
    return entry


def is_compiled(loop: Loop, title: str, constants: Constants | None = None, apart: tuple[str, ...] = ()) -> bool:
    """Return whether `compiled_loop` would find it on the disk."""
    return is_kept(*_named(loop, title, constants, apart))


def signature_of(loop: Loop) -> Any:  # noqa: ANN401 - numba has no types
    """Return numba's signature of ``loop``."""
    *arguments, result = map(_numba_type, get_type_hints(loop, include_extras=True).values())
    return result(*arguments)


def _named(loop: Loop, title: str, constants: Constants | None, apart: tuple[str, ...]) -> tuple[str, str, str]:
    """Title, source and key of the entry point."""
    hints = get_type_hints(loop)
    numbers = {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in (constants or {}).items()}
    tuples = [(h.__module__, h.__qualname__, h._fields) for h in hints.values() if hasattr(h, "_fields")]
    key = digest(loop, constants=numbers, apart=apart, tuples=tuples, signature=str(signature_of(loop)))
    return title, _SOURCE.format(names=", ".join(name for name in hints if name != "return")), key


def _numba_type(hint: Any) -> Any:  # noqa: ANN401 - an annotation
    from numba import types

    plain = {float: types.float64, int: types.int64, bool: types.boolean, type(None): types.void}
    elements = {FloatArray: types.float64, IntArray: types.int64, BoolArray: types.boolean}
    if hint in plain:
        return plain[hint]
    if get_origin(hint) is Annotated:
        array, axes = get_args(hint)
        return types.Array(elements[array], axes, "C")
    if get_origin(hint) is tuple:
        return types.Tuple([*map(_numba_type, get_args(hint))])
    return types.NamedTuple([*map(_numba_type, get_type_hints(hint, include_extras=True).values())], hint)


# Work in a process beside this one, which leaves its result on the disk.

RUNNING: Final[list[subprocess.Popen[bytes]]] = []
"""Kept, for Python warns of a process whose object goes while it runs."""


def run_beside(code: str) -> None:
    """Start a process that runs ``code``, and do not wait for it; what it says is not shown.

    It compiles for what this one compiles for. It outlives this one and its Ctrl-C: what it compiles is kept.
    """
    nothing, words = subprocess.DEVNULL, [sys.executable, "-c", code]
    own = os.environ | dict(zip(("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES"), target()[1:], strict=True))
    process = subprocess.Popen(words, stdin=nothing, stdout=nothing, stderr=nothing, start_new_session=True, env=own)  # noqa: S603 - our own code
    RUNNING.append(process)
