"""Engines that run a filter with an adaptation over a timeline; same inputs, same outputs.

The kernel of the compiled one is in `jerkbench/kinematic/`.
"""

from collections.abc import Iterable
from typing import Any


def announce(methods: Iterable[Any]) -> None:
    """Call `announce` of each engine with its filters and adaptations, before the processes of a sweep start.

    Args:
        methods: objects with an ``engine``, a ``filter`` and an ``adaptation``.
    """
    of_engine: dict[Any, list[tuple[Any, Any]]] = {}
    for method in methods:
        if hasattr(method.engine, "announce"):
            of_engine.setdefault(method.engine, []).append((method.filter, method.adaptation))
    for engine, own in of_engine.items():
        engine.announce(own)
