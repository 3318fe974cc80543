"""The question whether a plugin has an optional part."""

from functools import cache


def has_methods(plugin: object, protocol: type) -> bool:
    """Whether the class of a plugin has the methods of a ``protocol`` that asks for methods alone."""
    kind: type = type(plugin)
    return _has_methods(kind, protocol)


@cache
def _has_methods(kind: type, protocol: type) -> bool:
    """As `isinstance` says, which takes ten microseconds each time: of a sweep each run asks."""
    return issubclass(kind, protocol)
