"""The text and the names use the terms of the field: the count of private words and patterns may only fall."""

import io
import re
import tokenize
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[1]

MAX_PRIVATE_WORDS = 114
"""Private words and patterns in the package and its pages; the aim is 8 for each 1 000 lines of the package."""

NAMES = re.compile(
    "own|chosen|told|tell|kept|keep|asked|ask|stands?|room|place|words?|sentence|looks?|journey|passage|verbs?|knob|bundle"
    "|parcel|entrant|laws?|stray|strayed|exchange|doctor|remark|turned|apart|usual|whole|lost|alone|gone|lent|nobody"
)
"""Words that have had a private meaning in names, for example `own` for builtin, user or original."""

WORDS = re.compile(
    "told|kept|asked|stands|nobody|besides?|alike|anew|likewise|journey|knob|entrant|doctor|wholly|whoever|whichever"
    "|thereof|hears|heard",
    re.IGNORECASE,
)
"""Words that documentation of software does not use."""

PATTERNS = {
    "'what ...' as a noun": r"(?<![\w'])[Ww]hat (?:is|a|an|the|was|were|has|have|it|they|all|one|no|some|each|every"
    r"|runs|comes|goes|others?)\b(?![^.]*\?)",
    "'that of', 'those of', 'the one of'": r"\b(?:that|those) of\b|\bthe one (?:of|that)\b",
    "'so many' without 'as' or 'that'": r"\b[Ss]o (?:many|long|much|often|far)\b(?! as\b)(?! that\b)",
    "'is no', 'are none'": r"\b(?:is|are|was|were) (?:no|none)\b(?! longer)",
}
SOURCE_PATTERNS = {
    "constants named MOST_, LEAST_, ...": r"\b_?(?:MOST|LEAST|LONGEST|FEWEST|LARGEST|SMALLEST|SHORTEST|STEEPEST|HIGHEST"
    r"|NEAREST)(?:_[A-Z0-9_]+)?\b",
    "docstrings that begin with What, How, ...": r'"""(?:What|How|Which|Where|Whether|So|Those|That)\b',
}


def is_private(name):
    return any(NAMES.fullmatch(part.lower()) for part in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", name))


def text_counts(text):
    counts = Counter({name: len(re.findall(pattern, text)) for name, pattern in PATTERNS.items()})
    counts["words in text"] = sum(bool(WORDS.fullmatch(word)) for word in re.findall(r"[A-Za-z]+", text))
    return counts


def module_counts(source):
    tokens = list(tokenize.generate_tokens(io.StringIO(source).readline))
    written = (tokenize.STRING, tokenize.COMMENT, getattr(tokenize, "FSTRING_MIDDLE", -1))
    counts = text_counts("\n".join(token.string for token in tokens if token.type in written))
    counts["words in names"] = sum(token.type == tokenize.NAME and is_private(token.string) for token in tokens)
    counts.update({name: len(re.findall(pattern, source)) for name, pattern in SOURCE_PATTERNS.items()})
    return counts


def private_words():
    counts = Counter()
    for folder in ("jerkbench", "hydra_plugins"):
        for path in (ROOT / folder).rglob("*.py"):
            counts += module_counts(path.read_text(encoding="utf-8"))
    pages = [
        ROOT / "README.md",
        ROOT / "CONTRIBUTING.md",
        *ROOT.glob("docs/**/*.md"),
        *ROOT.glob("experiments/**/*.md"),
    ]
    for path in pages:
        counts += text_counts(re.sub(r"```.*?```", "", path.read_text(encoding="utf-8"), flags=re.DOTALL))
    return counts


def test_private_words_become_fewer():
    counts = private_words()

    assert counts.total() <= MAX_PRIVATE_WORDS, dict(counts)


def test_the_count_finds_each_kind():
    module = '"""What is kept."""\nMOST_RUNS = 1  # that of nobody\ntold = "there is no run, so many"\n'

    assert module_counts(module) == {
        "'what ...' as a noun": 1,
        "'that of', 'those of', 'the one of'": 1,
        "'so many' without 'as' or 'that'": 1,
        "'is no', 'are none'": 1,
        "words in text": 2,
        "words in names": 1,
        "constants named MOST_, LEAST_, ...": 1,
        "docstrings that begin with What, How, ...": 1,
    }
