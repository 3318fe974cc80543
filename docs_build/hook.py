"""Pages and figures that are made when the site is built: of each plugin, preset, metric, study and board."""

from collections.abc import Mapping
from typing import Any

from links import copied, studies, with_links_inside
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page
from plugin_pages import metrics_page, plugin_pages

METRICS = "metrics.md"
"""The page with every metric's equation."""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that are made, and the sources that pages link to."""
    pages, nav = plugin_pages()
    made = {**pages, METRICS: metrics_page(), **studies(), **copied(config["docs_dir"])}
    for path, content in made.items():
        files.append(File.generated(config, path, content=content))
    _extend(config["nav"], nav)
    return files


def on_page_markdown(markdown: str, page: Page, **_: object) -> str:
    """Turn links that lead out of docs/ into links within the site."""
    return with_links_inside(markdown, page.file.src_uri)


def _extend(nav: list[Any], kinds: Mapping[str, list[str]]) -> None:
    """Put the pages of each kind into the navigation, below the entry that mkdocs.yml has for it."""
    for entry in nav:
        for title, value in entry.items():
            if title == "Plugins":
                entry[title] = [*value, *({kind: paths} for kind, paths in kinds.items())]
