"""The condition of a check."""


class Unfit(AssertionError):  # noqa: N818 - pytest shows an assertion's sentence best
    """Something that a plugin promises and does not keep; other assertions are the plugin's own."""


def require(ok: object, sentence: str) -> None:
    """Raise an `Unfit` with ``sentence`` unless ``ok``; unlike `assert` also under ``python -O``."""
    if not ok:
        raise Unfit(sentence)
