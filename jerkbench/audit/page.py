"""The page of an audit, its pictures and its numbers for programs; every sentence with a number comes from the rows."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pandas as pd

from jerkbench import plugins
from jerkbench.audit.answer import NO_FAULT, AuditAnswer, kinds_of, told_truth
from jerkbench.audit.figures import kinds_figure
from jerkbench.audit.words import EQUAL, counts, counts_of, interval, percent, three_sentences
from jerkbench.evaluation.statistics.drives_and_tunings import Statement
from jerkbench.evaluation.statistics.intervals import share_interval
from jerkbench.files import write_text
from jerkbench.parameters import provenance_of
from jerkbench.report.plots.style import save_figure
from jerkbench.report.tables.writers import plain_table

TEMPLATE = Path(__file__).with_name("page.md.jinja")

ELSEWHERE = ("journeys", "vehicles", "attitude")
"""Studies beside the audit, of real recordings; what each found stands in its folder, in `FOUND`."""
FOUND = "answer.md"
SECOND = "second.md"
"""What an audit with other drives and tunings had in common, where it was compared."""
SHOWN = 15
"""Methods in the table of worst cases."""


def write_page(answer: AuditAnswer, folder: Path, commit: str) -> None:
    """Write README.md, its pictures, methods.csv, kinds.csv, apart.csv and answer.json into ``folder``."""
    margin = answer.rows.protocol.margin
    kinds, methods = (table.assign(name=_names(table)) for table in (answer.kinds, answer.methods))
    save_figure(kinds_figure(kinds, methods, margin), folder / "kinds.png")
    kinds, means = (t.assign(name=t["adaptation"]) for t in (answer.adaptations_by_kind, answer.adaptations))
    save_figure(kinds_figure(kinds, means, margin), folder / "answer.png")
    for name in ("methods", "kinds", "apart"):
        write_text(folder / f"{name}.csv", getattr(answer, name).to_csv(index=False, lineterminator="\n"))
    write_text(folder / "answer.json", json.dumps(answer_summary(answer, commit), indent=1) + "\n")
    write_text(folder / "README.md", audit_page(answer, folder, commit))


def answer_summary(answer: AuditAnswer, commit: str) -> dict[str, object]:
    """Return the answer for programs, as the front page of the repository is."""
    protocol, said = answer.rows.protocol, answer.said
    return {
        "protocol": protocol.digest,
        "commit": commit,
        "drives": protocol.judged_drives,
        "faulty": float(1.0 - kinds_of(answer.rows)[NO_FAULT].mean()),
        "tunings": protocol.tunings,
        "methods": len(answer.methods),
        "adaptations": len(protocol.compared),
        "filters": list(protocol.filters),
        "sentences": three_sentences(answer),
        "against_own_plain": counts(said.own_plain),
        "against_best_plain": counts(said.best_plain),
        "average": asdict(said.average) | {"verdict": str(said.average.verdict)},
        "pick": asdict(said.pick) | {"verdict": str(said.pick.verdict)},
        "error": answer.error._asdict(),
        "take": json.loads(answer.take.to_json(orient="records")),
    }


def audit_page(answer: AuditAnswer, folder: Path, commit: str) -> str:
    """Return the page as Markdown; what was found elsewhere is read beside ``folder``."""
    from jinja2 import Environment, StrictUndefined

    status = answer.rows.judged["status"].astype(str)
    levels = answer.rows.judged["seed"].map(answer.rows.drives.set_index("seed")["level"]).to_numpy()
    found = [folder.parent / name / FOUND for name in ELSEWHERE]
    values = {
        "p": answer.rows.protocol,
        "scale": folder.name.rpartition("-")[2],
        "commit": commit or "unknown",
        "sentences": three_sentences(answer),
        "methods": answer.methods,
        "n": len(answer.methods),
        "error": answer.error,
        "errs": share_interval(answer.error.wrong, answer.error.audits),
        "dear": np.exp(answer.rows.judged["log_error"] - levels) > answer.rows.protocol.lost_costs,
        "at_costs": answer.at_costs,
        "runs": len(status),
        "failed": status.str.startswith("failed").sum(),
        "take": _take(answer.take),
        "by_kind": _by_kind(answer.kinds),
        "worst": _worst(answer.methods),
        "shown": SHOWN,
        "steps": columns_table({"step": answer.steps.index, "error": _two(answer.steps)}),
        "apart": _apart(answer.apart),
        "truth": told_truth(answer),
        "elsewhere": _texts(found),
        "second": _texts([folder / SECOND]),
        "table": _table(answer.methods),
        "sources": _sources(answer.rows.protocol.compared),
    }
    environment = Environment(undefined=StrictUndefined, keep_trailing_newline=True)  # noqa: S701 - Markdown, no HTML
    environment.filters |= {"interval": interval, "percent": percent, "two": "{:.2f}".format, "verdicts": _verdicts}
    return environment.from_string(TEMPLATE.read_text(encoding="utf-8")).render(values)


def _verdicts(said: Sequence[Statement]) -> str:
    return ", ".join(f"{count} {word}" for word, count in counts(said).items())


def _texts(paths: Iterable[Path]) -> str:
    return "\n\n".join(path.read_text(encoding="utf-8").strip() for path in paths if path.exists())


# The tables, a column a key.


def columns_table(columns: Mapping[str, Iterable[object]]) -> str:
    """Return a Markdown table."""
    return plain_table(columns, zip(*columns.values(), strict=True))


def _table(methods: pd.DataFrame) -> str:
    return columns_table(
        {
            "method": _names(methods),
            "own plain filter": _ratios(methods, "own_"),
            "best plain filter": _ratios(methods, "best_"),
            "untuned": _two(methods["untuned"]),
            "no fault": _ratios(methods, "no_fault_"),
            "lost runs": [f"{100 * share:.1f} %" for share in methods["lost"]],
        }
    )


def _worst(methods: pd.DataFrame) -> str:
    least = methods.dropna(subset=["worst_high"]).sort_values("worst_high", kind="stable").head(SHOWN)
    return columns_table(
        {
            "method": _names(least),
            "highest ratio": _two(least["highest_ratio"]),
            "least certain kind": _spaced(least["worst_kind"]),
            "ratio there": _two(least["worst_ratio"]),
            "at most": _two(least["worst_high"]),
            "kinds better": least["better_kinds"],
            "kinds worse": least["worse_kinds"],
            "worse by 3 %": _shares(least, "worse_3"),
            "worse by 100 %": _shares(least, "worse_100"),
        }
    )


def _apart(apart: pd.DataFrame) -> str:
    if apart.empty:
        return "There is none in this protocol."
    against = {"best plain filter": _ratios(apart, "best_"), "itself without adaptation": _ratios(apart, "own_")}
    lost = [f"{100 * share:.1f} %" for share in apart["lost"]]
    return columns_table({"estimator": _names(apart), **against, "lost runs": lost})


def _take(take: pd.DataFrame) -> str:
    against: dict[str, Iterable[object]] = {
        "against the best plain filter": _ratios(take, ""),
        "drives": take["drives"],
    }
    return columns_table({"when": _spaced(take["when"]), "take": take["take"], **against})


def _by_kind(kinds: pd.DataFrame) -> str:
    """For each kind of fault: drives, methods better and worse, the lowest and the highest ratio."""
    lines = []
    for kind, own in kinds.assign(name=_names(kinds)).groupby("kind"):
        shown, ends = counts_of(own["verdict"]), own.sort_values("ratio").iloc[[0, -1]]
        low, high = (f"{name} {ratio}" for name, ratio in zip(ends["name"], _two(ends["ratio"]), strict=True))
        lines.append((kind, own["drives"].iloc[0], shown["better"], shown["worse"], low, high))
    lines.sort(key=lambda line: (line[0] != NO_FAULT, -line[2], line[3]))
    table = pd.DataFrame(lines, columns=["kind", "drives", "better", "worse", "lowest ratio", "highest ratio"])
    return columns_table({str(name): own for name, own in table.assign(kind=_spaced(table["kind"])).items()})


def _sources(adaptations: Sequence[str]) -> str:
    known = [(name, provenance_of(plugins.get("adaptation", name))) for name in adaptations]
    lines = [(name, of.kind, of.source, of.note) for name, of in known if of]
    head = ("adaptation", "is", "source", "what differs")
    return columns_table(dict(zip(head, zip(*lines, strict=True), strict=True)))


def _names(table: pd.DataFrame) -> "pd.Series[str]":
    return table["filter"] + " + " + table["adaptation"]


def _spaced(texts: "pd.Series[str]") -> "pd.Series[str]":
    return texts.str.replace("_", " ")


def _two(numbers: "pd.Series[float]") -> list[str]:
    return [f"{number:.2f}" for number in numbers]


def _ratios(table: pd.DataFrame, prefix: str) -> list[str]:
    """Ratios with their intervals and verdicts; empty where there is none."""
    columns = [table[prefix + name] for name in ("ratio", "low", "high", "verdict", "small")]
    return [
        f"{ratio:.2f} [{low:.2f}, {high:.2f}] {EQUAL if word == 'equal' else word}"
        + (", by less than 10 %" if small and word in ("better", "worse") else "")
        if np.isfinite(ratio)
        else ""
        for ratio, low, high, word, small in zip(*columns, strict=True)
    ]


def _shares(table: pd.DataFrame, name: str) -> list[str]:
    columns = [100 * table[name + end] for end in ("", "_low", "_high")]
    return [f"{share:.0f} % [{low:.0f} %, {high:.0f} %]" for share, low, high in zip(*columns, strict=True)]
