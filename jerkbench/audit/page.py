"""The page of an audit, its pictures and its numbers for programs; every sentence with a number comes from the rows."""

import json
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from jerkbench import plugins
from jerkbench.audit.answer import Answer
from jerkbench.audit.figures import kinds_figure
from jerkbench.audit.losses import cubes
from jerkbench.audit.protocol import AuditMethod
from jerkbench.audit.words import (
    cost_sentences,
    counts,
    error_sentence,
    kind_lines,
    percent,
    price_sentences,
    steps_table,
    take_lines,
    three_sentences,
)
from jerkbench.evaluation.statistics.drives_and_tunings import Statement
from jerkbench.files import write_text
from jerkbench.parameters import provenance_of
from jerkbench.report.plots.style import save_figure

TEMPLATE = Path(__file__).with_name("page.md.jinja")

ELSEWHERE = ("journeys", "vehicles", "attitude")
"""Studies beside the audit, of real recordings; what each found stands in its folder, in `FOUND`."""
FOUND = "answer.md"
SECOND = "second.md"
"""What an audit with other drives and tunings had in common, where it was compared."""
SHOWN = 15
"""Methods in the table of worst cases."""


def write_page(answer: Answer, folder: Path, commit: str) -> None:
    """Write README.md, its pictures, methods.csv, kinds.csv and answer.json into ``folder``."""
    margin = answer.rows.protocol.margin
    of_methods = {name: _named(getattr(answer, name)) for name in ("kinds", "methods")}
    by_kind, overall = (
        own.rename(columns={"adaptation": "name"}) for own in (answer.adaptations_by_kind, answer.adaptations)
    )
    save_figure(kinds_figure(by_kind, overall, margin), folder / "answer.png")
    save_figure(kinds_figure(of_methods["kinds"], of_methods["methods"], margin), folder / "kinds.png")
    for name in ("methods", "kinds", "apart"):
        write_text(folder / f"{name}.csv", getattr(answer, name).to_csv(index=False, lineterminator="\n"))
    write_text(folder / "answer.json", json.dumps(summary(answer, commit), indent=1) + "\n")
    write_text(folder / "README.md", page(answer, folder, commit))


def summary(answer: Answer, commit: str) -> dict[str, object]:
    """Return the answer for programs, as the front page of the repository is."""
    protocol, said = answer.rows.protocol, answer.said
    return {
        "protocol": protocol.digest,
        "commit": commit,
        "drives": protocol.judged_drives,
        "tunings": protocol.tunings,
        "methods": len(answer.methods),
        "adaptations": len(protocol.compared),
        "filters": list(protocol.filters),
        "sentences": three_sentences(answer),
        "against_own_plain": counts(said.own_plain),
        "against_best_plain": counts(said.best_plain),
        "average": _plain(said.average),
        "pick": _plain(said.pick),
        "error": answer.error._asdict(),
        "take": json.loads(answer.take.to_json(orient="records")),
    }


def _plain(said: Statement) -> dict[str, object]:
    return asdict(said) | {"verdict": str(said.verdict)}


def _named(table: pd.DataFrame) -> pd.DataFrame:
    return table.assign(name=table["filter"] + " + " + table["adaptation"])


def page(answer: Answer, folder: Path, commit: str) -> str:
    """Return the page as Markdown; what was found elsewhere is read beside ``folder``."""
    from jinja2 import Environment, StrictUndefined

    environment = Environment(undefined=StrictUndefined, keep_trailing_newline=True)  # noqa: S701 - Markdown, no HTML
    return environment.from_string(TEMPLATE.read_text(encoding="utf-8")).render(_values(answer, folder, commit))


def _values(answer: Answer, folder: Path, commit: str) -> Mapping[str, object]:
    """The names of the template."""
    second = folder / SECOND
    steps = [(name, f"{ratio:.2f}") for name, ratio in steps_table(answer)]
    return {
        "p": answer.rows.protocol,
        "scale": folder.name.rpartition("-")[2],
        "commit": commit or "unknown",
        "changes": commit.endswith("+changes"),
        "sentences": three_sentences(answer),
        "methods": answer.methods,
        "take": markdown(("when", "take", "error / best plain filter [95 %]", "drives"), take_lines(answer.take)),
        "price": price_sentences(answer),
        "by_kind": markdown(("kind", "drives", "better", "worse", "lowest ratio", "highest ratio"), kind_lines(answer)),
        "worst": _worst(answer.methods),
        "shown": SHOWN,
        "steps": markdown(("step", "error"), steps),
        "apart": _apart(answer.apart),
        "told": _told(answer),
        "elsewhere": _elsewhere(folder.parent),
        "error": error_sentence(answer),
        "at_costs": cost_sentences(answer),
        "second": second.read_text(encoding="utf-8").strip() if second.exists() else "",
        "lost": _lost(answer),
        "table": _table(answer.methods),
        "sources": _sources(answer.rows.protocol.compared),
    }


def markdown(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table."""
    return "\n".join("| " + " | ".join(line) + " |" for line in [head, ["---"] * len(head), *rows])


def _ratio(row: Mapping[Hashable, Any], prefix: str) -> str:
    ratio, low, high = (row[f"{prefix}_{name}"] for name in ("ratio", "low", "high"))
    return f"{ratio:.2f} [{low:.2f}, {high:.2f}]" if np.isfinite(ratio) else ""


def _verdict(row: Mapping[Hashable, Any], prefix: str) -> str:
    word, small = str(row[f"{prefix}_verdict"]), row[f"{prefix}_small"]
    return f"{word}, by less than 10 %" if small and word in ("better", "worse") else word


def _table(methods: pd.DataFrame) -> str:
    head = ("method", "own plain filter", "verdict", "best plain filter", "verdict", "untuned", "no fault", "lost runs")
    lines = [
        (
            f"{row['filter']} + {row['adaptation']}",
            _ratio(row, "own"),
            _verdict(row, "own"),
            _ratio(row, "best"),
            _verdict(row, "best"),
            f"{row['untuned']:.2f}",
            _ratio(row, "no_fault"),
            f"{100 * row['lost']:.1f} %",
        )
        for row in methods.to_dict("records")
    ]
    return markdown(head, lines)


def _worst(methods: pd.DataFrame) -> str:
    heads = [
        "method",
        "worst kind",
        "ratio there",
        "at most",
        "kinds better",
        "kinds worse",
        "worse by 3 %",
        "worse by 100 %",
    ]
    least = methods.dropna(subset=["worst_high"]).sort_values("worst_high", kind="stable").head(SHOWN)
    lines = [
        (
            f"{row['filter']} + {row['adaptation']}",
            str(row["worst_kind"]).replace("_", " "),
            f"{row['worst_ratio']:.2f}",
            f"{row['worst_high']:.2f}",
            f"{row['better_kinds']}",
            f"{row['worse_kinds']}",
            f"{percent(row['worse_3'])} [{percent(row['worse_3_low'])}, {percent(row['worse_3_high'])}]",
            f"{percent(row['worse_100'])} [{percent(row['worse_100_low'])}, {percent(row['worse_100_high'])}]",
        )
        for row in least.to_dict("records")
    ]
    return markdown(heads, lines)


def _apart(apart: pd.DataFrame) -> str:
    head = ("estimator", "best plain filter", "verdict", "itself without adaptation", "verdict", "lost runs")
    lines = [
        (
            f"{row['filter']} + {row['adaptation']}",
            _ratio(row, "best"),
            _verdict(row, "best"),
            _ratio(row, "own"),
            _verdict(row, "own") if np.isfinite(row["own_ratio"]) else "",
            f"{100 * row['lost']:.1f} %",
        )
        for row in apart.to_dict("records")
    ]
    return markdown(head, lines)


def _told(answer: Answer) -> str:
    """What the plain filters have where they are told the true R."""
    protocol, parts = answer.rows.protocol, []
    for reference in protocol.references:
        told = cubes(answer.rows, [AuditMethod(model, reference) for model in protocol.filters]).tuned
        ratios = np.exp((told - answer.losses.plains).mean(axis=(1, 2)))
        parts += [f"{ratio:.2f} ({model})" for model, ratio in zip(protocol.filters, ratios, strict=True)]
    head = "A plain filter that is told the true covariance of each measurement has this share of its error:"
    return f"{head} {', '.join(parts)}." if parts else ""


def _elsewhere(results: Path) -> str:
    found = [results / name / FOUND for name in ELSEWHERE]
    return "\n\n".join(path.read_text(encoding="utf-8").strip() for path in found if path.exists())


def _lost(answer: Answer) -> str:
    methods, status = answer.methods, answer.rows.judged["status"].astype(str)
    failed = int(status.str.startswith("failed").sum())
    return (
        f"{int((methods['lost'] > 0).sum())} of {len(methods)} methods lost runs, at most"
        f" {100 * methods['lost'].max():.1f} % of them. {failed} of {len(status)} runs ended in an error of the"
        " program."
    )


def _sources(adaptations: Sequence[str]) -> str:
    lines = []
    for name in adaptations:
        known = provenance_of(plugins.get("adaptation", name))
        lines.append((name, known.kind, known.source, known.note) if known else (name, "", "", ""))
    return markdown(("adaptation", "is", "source", "what differs"), lines)
