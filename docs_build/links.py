"""Links of docs/ that work in a clone, as links within the site.

Studies and the leaderboard are pages of the site. Other files of the repository are copied into it.
"""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]

OUTWARD = re.compile(r"\]\(\.\./([\w./-]+)")
"""A link from a page in docs/ to a file of the repository."""

PLUGIN = re.compile(r"\]\(plugins/(\w+)/index\.md#(\w+)\)")
"""A link to a plugin. The site has a page for each plugin; a clone has only the page of each kind."""

STUDIES = ("experiments/*/README.md", "results/suite-*/board.md")
"""Pages outside docs/. They have the same paths in the site, so that the links between them work."""

FOLDER = "source"
"""Folder of the copied files in the site."""


def studies() -> dict[str, str | bytes]:
    """Return the pages outside docs/ and their pictures, by their paths in the site."""
    pages = [page for pattern in STUDIES for page in sorted(ROOT.glob(pattern))]
    pictures = [picture for page in pages for picture in sorted(page.parent.glob("*.png"))]
    return {
        **{_path(page): page.read_text(encoding="utf-8") for page in pages},
        **{_path(picture): picture.read_bytes() for picture in pictures},
    }


def copied(docs: str) -> dict[str, str]:
    """Return the content of every other file that a page links to, by its path in the site."""
    texts = (page.read_text(encoding="utf-8") for page in sorted(Path(docs).glob("*.md")))
    targets = sorted({target for text in texts for target in OUTWARD.findall(text)})
    return {_in_site(target): (ROOT / target).read_text(encoding="utf-8") for target in targets if not _is_page(target)}


def with_site_links(markdown: str, page: str) -> str:
    """Return the text of a page with links to plugins and to files of the repository as the site has them."""
    if _is_page(page):
        return markdown
    text = PLUGIN.sub(r"](plugins/\1/\2.md)", markdown)
    return text if "/" in page else OUTWARD.sub(lambda link: f"]({_in_site(link[1])}", text)


def _is_page(path: str) -> bool:
    return any(Path(path).match(pattern) for pattern in STUDIES)


def _in_site(target: str) -> str:
    """Return the path of a page, or of a copy. The copy has an extension that no browser executes."""
    return target if _is_page(target) else f"{FOLDER}/{target}.txt"


def _path(file: Path) -> str:
    return file.relative_to(ROOT).as_posix()
