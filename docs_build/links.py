"""Files of the repository that pages link to: studies and boards are pages of the site, others are copied into it."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]

OUTWARD = re.compile(r"\]\(\.\./([\w./-]+)\)")
"""A link of a page of docs/ to a file of the repository."""

STUDIES = ("experiments/*/README.md", "results/suite-*/board.md")
"""Pages that stand outside docs/, with the pictures beside them; they keep their paths, and so their links."""

FOLDER = "source"
"""Where the copies stand in the site."""


def studies() -> dict[str, str | bytes]:
    """Return the pages that stand outside docs/ and their pictures, by their paths in the site."""
    pages = [page for pattern in STUDIES for page in sorted(ROOT.glob(pattern))]
    pictures = [picture for page in pages for picture in sorted(page.parent.glob("*.png"))]
    return {
        **{_path(page): page.read_text(encoding="utf-8") for page in pages},
        **{_path(picture): picture.read_bytes() for picture in pictures},
    }


def copied(docs: str) -> dict[str, str]:
    """Return the content of every other file that some page links to, by its path in the site."""
    texts = (page.read_text(encoding="utf-8") for page in sorted(Path(docs).glob("*.md")))
    targets = sorted({target for text in texts for target in OUTWARD.findall(text)})
    return {_in_site(target): (ROOT / target).read_text(encoding="utf-8") for target in targets if not _is_page(target)}


def with_links_inside(markdown: str, page: str) -> str:
    """Return the text of a page of docs/ with its outward links to what the site has of them."""
    if _is_page(page):
        return markdown
    up = "../" * page.count("/")
    return OUTWARD.sub(lambda link: f"]({up}{_in_site(link[1])})", markdown)


def _is_page(path: str) -> bool:
    return any(Path(path).match(pattern) for pattern in STUDIES)


def _in_site(target: str) -> str:
    """The path of a page, or of a copy with a name that no browser runs."""
    return target if _is_page(target) else f"{FOLDER}/{target}.txt"


def _path(file: Path) -> str:
    return file.relative_to(ROOT).as_posix()
