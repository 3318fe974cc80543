"""Links of the pages that lead out of docs/: in a checkout to the file, in the site to a copy of it."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]

OUTWARD = re.compile(r"\]\(\.\./([\w./-]+)\)")
"""A link to a file of the repository that is no page."""

FOLDER = "source"
"""Where the copies stand in the site."""


def copied(docs: str) -> dict[str, str]:
    """Return the content of every file that some page links to, by its path in the site."""
    texts = (page.read_text(encoding="utf-8") for page in sorted(Path(docs).glob("*.md")))
    targets = sorted({target for text in texts for target in OUTWARD.findall(text)})
    return {_copy_of(target): (ROOT / target).read_text(encoding="utf-8") for target in targets}


def with_copies(markdown: str, page: str) -> str:
    """Return the text of a page with its outward links to the copies."""
    up = "../" * page.count("/")
    return OUTWARD.sub(lambda link: f"]({up}{_copy_of(link[1])})", markdown)


def _copy_of(target: str) -> str:
    """A name that no browser runs and that is no page."""
    return f"{FOLDER}/{target}.txt"
