"""One line of a check."""


def require(ok: object, sentence: str) -> None:
    """Raise an AssertionError with ``sentence`` unless ``ok``; unlike `assert` also under ``python -O``."""
    if not ok:
        raise AssertionError(sentence)
