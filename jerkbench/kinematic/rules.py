"""Compilation of adaptations: wrapper functions with a fixed signature call the unchanged methods of a plugin.

The compiled loop passes arrays with the data of eight runs to a wrapper. If the plugin has ``lanes = True``, the
wrapper calls the plugin once for all runs that ``selected`` marks. If ``lanes`` is false, the wrapper calls the plugin
separately for each run that ``selected`` marks. In each call, the wrapper creates a named tuple with the parameters of
the plugin from arrays of numbers. Therefore a compiled wrapper is valid for all values of the parameters. The source
code of the wrappers is generated. The generated code is stored in a file next to the compiled code, because numba
caches only functions whose source is a file.
"""

import dataclasses
import hashlib
import re
from collections import namedtuple
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from jerkbench.arrays import WIDE, FloatArray, IntArray, Keyed
from jerkbench.compilation.compiled import Compilation, can_compile, own_function, private_folder
from jerkbench.compilation.lanes import select
from jerkbench.compilation.vectors import aligned_zeros, in_lanes, of_run
from jerkbench.contracts import (
    Adaptation,
    AdaptingGain,
    asked_in_lanes,
    changes_nothing,
    memory_size,
    wants_truth,
)
from jerkbench.errors import notify
from jerkbench.files import write_text
from jerkbench.kalman import submatrix
from jerkbench.kinematic.arguments import Rules, called_type

PluginMethod = Callable[..., Any]

# The next functions call an adaptation for eight runs (elements are vectors) or for one run (elements are numbers).
# The argument ``fields`` is the named tuple with the parameters of the plugin.
# The methods of a plugin receive copies of the measured rows, because a method may change its arguments.
# Only the results of the selected runs are stored.


def adapt_runs(
    fields: Any,  # noqa: ANN401 - like all plugins
    adapt: PluginMethod,
    prior: PluginMethod | None,
    fade: PluginMethod | None,
    selected: float,
    arrays: tuple[FloatArray, ...],
    rows: IntArray,
    memory: FloatArray,
) -> bool:
    """Write the adapted R to the measured rows of ``adapted`` (6, 6), and the adapted prior covariance to P.

    The tuple ``arrays`` contains x, P, A, Q, y, R and ``adapted``. The function returns whether the plugin returned an
    R of shape (m, m).
    """
    x, P, A, Q, y, R, adapted = arrays
    m = len(rows)
    if fade is not None:
        factor = fade(fields, _rows_of(y, rows), submatrix(P, rows), submatrix(R, rows), rows, memory)
        for s in range(len(P)):
            for t in range(len(P)):
                P[s, t] *= select(selected, 0.0, factor, 1.0)
    if prior is not None:
        F, noise = _three_axes(A), _three_axes(Q)
        prior_P = prior(fields, x.copy(), P.copy(), F, noise, _rows_of(y, rows), submatrix(R, rows), rows, memory)
        for s in range(len(P)):
            for t in range(s + 1):
                P[s, t] = P[t, s] = select(selected, 0.0, 0.5 * (prior_P[s, t] + prior_P[t, s]), P[s, t])
    R_adapted = adapt(fields, _rows_of(y, rows), submatrix(P, rows), submatrix(R, rows), rows, memory)
    if R_adapted.shape != (m, m):
        return False
    for i in range(m):
        for j in range(m):
            r, c = rows[i], rows[j]
            adapted[r, c] = select(selected, 0.0, R_adapted[i, j], adapted[r, c])
    return True


def gain_runs(
    fields: Any,  # noqa: ANN401 - like all plugins
    gain: PluginMethod,
    selected: float,
    arrays: tuple[FloatArray, ...],
    rows: IntArray,
    memory: FloatArray,
) -> bool:
    """Write the transposed gain to the rows of ``found`` (6, n), and return whether the gain has the shape (n, m).

    The tuple ``arrays`` contains x, P, A, Q, y, R and ``found``.
    """
    x, P, _, _, y, R, found = arrays
    K = gain(fields, x.copy(), P.copy(), _rows_of(y, rows), submatrix(R, rows), rows, memory)
    if K.shape != (len(x), len(rows)):
        return False
    for i in range(len(rows)):
        for s in range(len(x)):
            found[rows[i], s] = select(selected, 0.0, K[s, i], found[rows[i], s])
    return True


def _rows_of(y: FloatArray, rows: IntArray) -> FloatArray:
    found = np.empty(len(rows), y.dtype)
    for i in range(len(rows)):
        found[i] = y[rows[i]]
    return found


def _three_axes(A: FloatArray) -> FloatArray:
    """Return the Kronecker product of A with I3, which is the matrix for all three axes."""
    n = len(A)
    F = np.zeros((3 * n, 3 * n), A.dtype)
    for a in range(n):
        for b in range(n):
            for i in range(3):
                F[3 * a + i, 3 * b + i] = A[a, b]
    return F


def restore_memory(memory: FloatArray, saved: FloatArray, selected: float) -> None:
    """Restore the memory of the runs that are not selected, because a batched call changes the memory of all runs."""
    for e in range(len(memory)):
        memory[e] = select(selected, 0.0, memory[e], saved[e])


# Templates of the generated wrappers, which have the signature `called_type`.
# If an adaptation raises an error, the run is repeated with the reference engine, which raises the error again.

_ALL_RUNS = """
def {title}(parameters, selected, x, P, A, Q, y, R, rows, memory, result, failed):
    numbers, chosen, saved = in_lanes(parameters), in_lanes(selected)[0], in_lanes(memory.copy())
    arrays = {arrays}
    if not {call}, chosen, arrays, rows, in_lanes(memory)):
        failed[:] = 1.0
    restore_memory(in_lanes(memory), saved, chosen)
"""

_EACH_RUN = """
def {title}(parameters, selected, x, P, A, Q, y, R, rows, memory, result, failed):
    arrays = {arrays}
    for k in range(8):
        if selected[0, k] > 0.0:
            try:
                numbers = parameters[:, k]
                if not {call}, 1.0, of_run(arrays, k), rows, memory[k]):
                    failed[0, k] = 1.0
            except Exception:
                failed[0, k] = 1.0
"""

_ARRAYS = "(in_lanes(x), in_lanes(P), in_lanes(A), in_lanes(Q), in_lanes(y), in_lanes(R), in_lanes(result))"


def _generated(plugin: Adaptation, *, lanes: bool) -> dict[str, Any]:
    """Generate and execute the source of the wrappers of ``plugin``, and return the namespace with the wrappers."""
    name, fields = type(plugin).__name__, f"Fields({_constructor(plugin, lanes=lanes)})"
    calls = {"adapt": f"adapt_runs({fields}, adapt, prior, fade", "gain": f"gain_runs({fields}, gain"}
    source = f'"""Written by jerkbench: the calls of {name}."""\n'
    for short, call in calls.items():
        source += (_ALL_RUNS if lanes else _EACH_RUN).format(title=f"{short}_{name}", call=call, arrays=_ARRAYS)
    record = namedtuple("Fields", [name for name, _ in _attributes(plugin)])  # type: ignore[misc]  # noqa: PYI024 - the fields are known only at run time
    methods = {short: _method(plugin, long) for short, long in _METHODS.items()}
    helpers = {function.__name__: function for function in (in_lanes, of_run, adapt_runs, gain_runs, restore_memory)}
    return _executed(name, source, {**methods, **helpers, "Fields": record})


def _executed(name: str, source: str, scope: dict[str, Any]) -> dict[str, Any]:
    folder = private_folder("adapters")
    path = (folder or Path("adapters")) / f"{name}-{hashlib.sha256(source.encode()).hexdigest()[:16]}.py"
    if folder and not path.exists():
        write_text(path, source)
    scope["__name__"] = __name__
    exec(compile(source, str(path), "exec"), scope)  # noqa: S102 - the text from above
    return scope


_METHODS = {"adapt": "adapt", "prior": "adapt_prior", "fade": "fade", "gain": "adapt_gain"}


def _method(plugin: Adaptation, name: str) -> PluginMethod | None:
    """Return the method ``name`` as a plain function, or None if the plugin does not have this method.

    Raises:
        TypeError: the method exists but is not a plain function.
    """
    found = getattr(type(plugin), name, None)
    function = own_function(found)
    if found is not None and function is None:
        raise TypeError(f"{type(plugin).__name__}.{name} is not a plain function")
    return function


def _constructor(plugin: Adaptation, *, lanes: bool) -> str:
    """Return the source of expressions that read the attributes of the plugin from arrays of numbers.

    In a batch, an integer is read from the parameters of the first run, unless the attribute ``varying`` of the plugin
    states that the integer may differ between the runs. Values that are not numbers, such as strings, become constants
    in the source.
    """
    index, texts = iter(range(10**6)), []
    for name, value in _attributes(plugin):
        varies = lanes and name in getattr(type(plugin), "varying", ())
        integer = "numbers[{}]" if not lanes or varies else "parameters[{}, 0]"
        texts.append(_text(value, index, integer, varies=varies))
    return ", ".join(texts)


def _text(value: object, index: Iterator[int], integer: str, *, varies: bool) -> str:
    if isinstance(value, (tuple, list)):
        return f"({''.join(f'{_text(item, index, integer, varies=varies)}, ' for item in value)})"
    if isinstance(value, bool):
        return f"{integer.format(next(index))} != 0"
    if isinstance(value, int) and not varies:
        return f"int({integer.format(next(index))})"
    if isinstance(value, (int, float)):
        return f"numbers[{next(index)}]"
    return repr(value)


def _attributes(plugin: Adaptation) -> list[tuple[str, Any]]:
    """Return the names and values of the fields of a plugin, and of the constants of its class."""
    names, constants = _attributes_of(type(plugin))
    return [*((name, getattr(plugin, name)) for name in names), *constants]


@lru_cache(maxsize=256)
def _attributes_of(cls: type[Any]) -> tuple[list[str], list[tuple[str, Any]]]:
    fields = [field.name for field in dataclasses.fields(cls)]
    constants = {
        name: value
        for base in reversed(cls.__mro__)
        for name, value in vars(base).items()
        if not name.startswith("_") and name not in fields and _is_constant(value)
    }
    return fields, sorted(constants.items())


def _is_constant(value: object) -> bool:
    return isinstance(value, (bool, int, float, str)) or (isinstance(value, tuple) and all(map(_is_constant, value)))


def _numbers(value: object) -> list[float]:
    if isinstance(value, (tuple, list)):
        return [number for item in value for number in _numbers(item)]
    return [value] if isinstance(value, (bool, int, float)) else []


# Python classes that call compiled adaptations.


class _Kind(Keyed):
    """A cache key of an adaptation that consists of its class and the source that reads its attributes.

    Adaptations with equal keys share the compiled code.
    """

    def __init__(self, adaptation: Adaptation) -> None:
        super().__init__((type(adaptation), _constructor(adaptation, lanes=False)))
        self.example = adaptation


@dataclass(frozen=True, eq=False)
class Rule:
    """An adaptation that numba can compile.

    Attributes:
        adaptation: the adaptation plugin.
        kind: the cache key of the compiled code.
        in_lanes: true if one call of the adaptation processes all runs of a batch, false if each run needs a separate
            call.
    """

    adaptation: Adaptation
    kind: _Kind
    in_lanes: bool

    @cached_property
    def numbers(self) -> list[tuple[str, float]]:
        """Pairs (attribute name, number), one for each number in the attributes of the plugin."""
        return [(name, number) for name, value in _attributes(self.adaptation) for number in _numbers(value)]

    def group(self, states: int) -> tuple[object, ...]:
        """Return a key that is equal for all rules whose runs can be processed in the same batch.

        The argument ``states`` is the number of states of the filter.
        """
        varying = getattr(type(self.adaptation), "varying", ())
        equal = [value for name, value in self.numbers if not isinstance(value, float) and name not in varying]
        further = equal if self.in_lanes else [memory_size(self.adaptation, states)]
        return self.kind, self.in_lanes, wants_truth(self.adaptation), *further

    def functions(self) -> tuple[Any, Any]:
        """Return the compiled function of the adaptation and the compiled function of its gain.

        If the adaptation does not compute a gain, the second function does nothing.
        """
        adapt, gain = _compilations(self.kind, self.in_lanes)
        return adapt.result(), gain.result()


def compiled_rule(adaptation: Adaptation, otherwise: str = "estimators with {} run in plain Python") -> Rule | None:
    """Return the compiled adaptation. If numba cannot compile the adaptation, print the reason and return None.

    Args:
        adaptation: the adaptation plugin.
        otherwise: start of the printed message, in which {} is replaced by the class name of the plugin.
    """
    kind, lanes, name = _Kind(adaptation), asked_in_lanes(adaptation), type(adaptation).__name__
    if lanes and (reason := _obstacle(kind, lanes=True)) and not _obstacle(kind, lanes=False):
        notify(f"{name} is called for each run separately, because it cannot be compiled for a batch of runs: {reason}")
        lanes = False
    if reason := _obstacle(kind, lanes):
        notify(f"{otherwise.format(name)}: {reason}")
        return None
    return Rule(adaptation, kind, lanes)


def obstacle(adaptation: Adaptation) -> str:
    """Return the reason why numba cannot compile ``adaptation``, or an empty string if numba can compile it."""
    return _obstacle(_Kind(adaptation), lanes=False)


@lru_cache(maxsize=256)
def _obstacle(kind: _Kind, lanes: bool) -> str:
    """Return the reason why numba cannot compile an adaptation, or an empty string if numba can compile it.

    If ``lanes`` is true, the adaptation is compiled for a batch of runs, otherwise for one run.
    """
    if not can_compile():
        return "NUMBA_DISABLE_JIT is set: numba compiles nothing"
    from numba.core.errors import NumbaError, UnsupportedBytecodeError  # UnsupportedBytecodeError is not a NumbaError

    try:
        for compilation in _compilations(kind, lanes):
            compilation.result()
        np.array([number for _, value in _attributes(kind.example) for number in _numbers(value)], dtype=np.float64)
    except (NumbaError, UnsupportedBytecodeError, TypeError) as error:
        return _first_reason(str(error))
    return ""


def _first_reason(message: str) -> str:
    """Return the first line of an error message of numba that states the reason of the error."""
    text = re.sub(r"\x1b\[[0-9;]*m", "", message)  # numba adds colour codes if colorama is installed
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    reasons = [line for line in lines if not line.startswith(("Failed in", "During:", "File", "[1"))]
    return (reasons or lines or ["numba cannot compile it"])[0]


@lru_cache(maxsize=256)
def _compilations(kind: _Kind, lanes: bool) -> tuple[Compilation, Compilation]:
    plugin, name = kind.example, type(kind.example).__name__
    if changes_nothing(plugin):
        return _never_called(), _never_called()
    scope = _generated(plugin, lanes=lanes)
    adapt = Compilation(scope[f"adapt_{name}"], f"adaptation {name}", called_type(), in_lanes=lanes)
    if scope["gain"] is None:
        return adapt, _never_called()
    return adapt, Compilation(scope[f"gain_{name}"], f"gain of adaptation {name}", called_type(), in_lanes=lanes)


def compilations_of(adaptation: Adaptation) -> tuple[Compilation, ...]:
    """Return the compilations of the adaptation and its gain, in the batched form if the plugin supports this form."""
    return _compilations(_Kind(adaptation), asked_in_lanes(adaptation))


@cache
def _never_called() -> Compilation:
    """Return the compilation of an empty function, which replaces a method that an adaptation does not have."""
    names = ", ".join(f"a{k}" for k in range(len(called_type().args)))
    scope = _executed("nothing", f"def nothing({names}):\n    return None\n", {})
    return Compilation(scope["nothing"], None, called_type())


def rules_of(rules: Sequence[Rule], states: int) -> Rules:
    """Return the parameters and the memory of up to eight rules with the same `Rule.group` as arrays.

    The argument ``states`` is the number of states of each filter.
    """
    first, parameters = rules[0], aligned_zeros(len(rules[0].numbers), WIDE)
    for k, rule in enumerate(rules):
        parameters[:, k] = [number for _, number in rule.numbers]
    parameters[:, len(rules) :] = parameters[:, :1]
    size = max(memory_size(rule.adaptation, states) for rule in rules)
    memory = aligned_zeros(max(size, 1), WIDE) if first.in_lanes else np.zeros((WIDE, size))
    called, rows = not changes_nothing(first.adaptation), np.zeros(6, dtype=np.int64)
    return Rules(parameters, memory, rows, called, isinstance(first.adaptation, AdaptingGain))
