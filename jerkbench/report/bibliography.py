"""BibTeX entries of the methods and data sets of a study, parsed from the docstrings of the plugins."""

import inspect
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from jerkbench import plugins

DOI = re.compile(r"doi:(10\.\d{4,}/[^\s,;]*[^\s,;.:)])")
"""Matches a DOI in a docstring."""

TITLED = re.compile(r'(?P<author>[^;:(]+?), "(?P<title>[^"]+?),?"[^"]*$')
UNTITLED = re.compile(r"\((?P<author>[^();]+?), \d{4}, $")
YEAR = re.compile(r"\b(?:19|20)\d\d\b(?!-)")

INITIAL = re.compile(r"\b[A-Z]\. ?-?[A-Z]")

PACKAGE_CITATION = "CITATION.cff"


def entries_of(specifications: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return BibTeX entries of jerkbench, and of the papers that describe the plugins of a study."""
    used: dict[type, str] = {}
    for specification in specifications:
        for kind, name in _plugins(specification):
            if name in plugins.names(kind):
                used.setdefault(plugins.get(kind, name), f"{kind} {name}")
    silent = [title for cls, title in used.items() if not (hasattr(cls, "citations") or list(_sources(cls)))]
    lacking = [f"% No source is stated by: {', '.join(silent)}."] if silent else []
    return [package_entry(), *dict.fromkeys(merged(used)), *lacking]


def merged(used: Mapping[type, str]) -> Iterator[str]:
    """Yield the BibTeX entries of plugins. Plugins with the same source have one entry, which lists the plugins."""
    sources: dict[str, tuple[str, list[str]]] = {}
    for cls, title in used.items():
        if hasattr(cls, "citations"):
            yield from cls.citations
        for doi, before in _sources(cls):
            sources.setdefault(doi, (before, []))[1].append(title)
    yield from (entry(doi, before, titles) for doi, (before, titles) in sources.items())


def entry(doi: str, before: str, titles: Iterable[str]) -> str:
    """Return the BibTeX entry of one source (a paper with a DOI).

    Args:
        doi: DOI of the source.
        before: text before the DOI in the docstring, with the authors, the title in quotation marks, and the year.
        titles: names of the plugins that implement the method of this source.
    """
    read = TITLED.search(before) or UNTITLED.search(before)
    known = {name: text for name, text in (read.groupdict() if read else {}).items() if text}
    if "author" in known:
        known["author"] = _authors(known["author"])
    years = YEAR.findall(before[read.start() :] if read else before[-80:])
    known |= {"year": years[-1]} if years else {}
    return _bibtex("misc", re.sub(r"\W+", "_", doi), known | {"doi": doi, "note": f"jerkbench: {', '.join(titles)}"})


def package_entry() -> str:
    """Return the BibTeX entry of this package, from its citation file."""
    from omegaconf import OmegaConf

    package = Path(__file__).parents[1]
    outside, inside = package.parent / PACKAGE_CITATION, package / PACKAGE_CITATION
    cited: Any = OmegaConf.to_container(OmegaConf.load(outside if outside.is_file() else inside))
    fields = {
        "author": " and ".join(f"{{{author['name']}}}" for author in cited["authors"]),
        "title": cited["title"],
        "year": str(cited["date-released"])[:4],
        "version": str(cited["version"]),
    }
    return _bibtex("software", "jerkbench", fields)


def _plugins(spec: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    for kind, part in spec.items():
        if kind in plugins.KINDS and isinstance(part, Mapping):
            yield kind, str(part["name"])
    yield from (("disturbance", str(part["name"])) for part in spec["disturbance"])


def _sources(cls: type) -> Iterator[tuple[str, str]]:
    """Yield each DOI in the docstrings of a plugin and its base classes, and the text that precedes the DOI."""
    for owner in (base for base in cls.__mro__ if base is not object and base.__doc__):
        text = " ".join(inspect.cleandoc(owner.__doc__ or "").split())
        yield from ((doi[1], text[: doi.start()]) for doi in DOI.finditer(text))


def _authors(text: str) -> str:
    """Return the authors in a reference as BibTeX expects them: names separated by "and".

    Text before the first initial of an author is ignored.
    """
    initial = INITIAL.search(text)
    names = re.split(r",? and |, (?=[A-Z]\.)" if initial else r",? and |, ", text[initial.start() if initial else 0 :])
    return " and ".join(name.strip() for name in names)


def _bibtex(kind: str, key: str, fields: Mapping[str, str]) -> str:
    width = max(map(len, fields))
    return "\n".join([f"@{kind}{{{key},", *(f"  {name:<{width}} = {{{text}}}," for name, text in fields.items()), "}"])
