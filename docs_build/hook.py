"""Content that is generated when the site is built: plugins, metrics, commands, studies and the leaderboard."""

from collections.abc import Mapping
from typing import Any

from commands_page import commands_help
from links import copied, studies, with_site_links
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page
from plugin_pages import metric_sections, plugin_pages

GENERATED: dict[str, str] = {}
"""Text that is appended to a page of docs/, by the path of the page."""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages and the source files that pages link to."""
    pages, lists, nav = plugin_pages()
    GENERATED.update({**lists, "metrics.md": metric_sections(), "commands.md": commands_help()})
    for path, content in {**pages, **studies(), **copied(config["docs_dir"])}.items():
        files.append(File.generated(config, path, content=content))
    _extend(config["nav"], nav)
    return files


def on_page_markdown(markdown: str, page: Page, **_: object) -> str:
    """Append the generated text, and replace links that work in a clone by links within the site."""
    path = page.file.src_uri
    return "\n\n".join([with_site_links(markdown, path), *([GENERATED[path]] if path in GENERATED else [])])


def _extend(nav: list[Any], kinds: Mapping[str, list[Any]]) -> None:
    """Add the plugin pages to the entry "Plugins" of the navigation, at any depth."""
    for title, value in ((title, value) for entry in nav if isinstance(entry, dict) for title, value in entry.items()):
        if title == "Plugins":
            value.extend({kind: paths} for kind, paths in kinds.items())
        elif isinstance(value, list):
            _extend(value, kinds)
