"""Templates -> HTML, with everything that a template prints escaped."""

import re
from base64 import b64encode
from collections.abc import Sequence
from functools import cache
from hashlib import sha256
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup

ROOMS = ("jerkbench.report.tables", "jerkbench.report.page")
"""Packages with a folder of templates."""

BREAKS = re.compile(r"(?<=\S[_+,(=])(?=\w)")
"""Where a long name may be broken."""


def render(template: str, **values: object) -> "Markup":
    """Return a template filled in; as safe HTML, which another template does not escape again.

    Args:
        template: name of its file.
        values: what it names; one that is not given is an error.
    """
    from markupsafe import Markup

    return Markup(environment().get_template(template).render(**values))  # noqa: S704 - the template escapes


@cache
def environment() -> "Environment":
    """Return where templates are found, and what they can call."""
    from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

    templates = Environment(
        loader=ChoiceLoader([PackageLoader(room) for room in ROOMS]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    templates.filters["breakable"] = breakable
    templates.globals["policy"] = policy
    return templates


def policy(scripts: Sequence[str]) -> str:
    """Return the Content-Security-Policy of a page that runs ``scripts`` alone, and loads nothing from elsewhere."""
    digests = " ".join(f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'" for text in scripts)
    return (
        f"default-src 'none'; script-src {digests}; style-src 'unsafe-inline'; img-src data:; base-uri 'none';"
        " form-action 'none'"
    )


def breakable(text: object) -> "Markup":
    """Return ``text`` escaped, with the places marked at which a long name may go on in the next line."""
    from markupsafe import Markup, escape

    return Markup("<wbr>").join(escape(part) for part in BREAKS.split(str(text)))
