"""The tables of the audit of attitude filters, as Markdown."""

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.audit.attitude.methods import AS_THEY_COME, METHODS
from jerkbench.audit.attitude.trials import DOMAINS
from jerkbench.audit.attitude.tuned import (
    TiltErrors,
    TiltVerdict,
    chosen,
    scored,
    tilt_verdicts,
    tried,
    tuned,
)

COMPARATORS = ("constant", "vqf")
"""Chosen before the rows were seen: the plain filter, and the field's best."""

RECORDED = ("broad", "tstick", "kitti")
"""Domains of which a setting may be tried on another: a simulation tells nothing about a hand."""

VERDICT_HEADS = ("mean ratio", "median ratio", "wins", "p (Holm)", "verdict")


def markdown(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def of_errors(errors: TiltErrors) -> str:
    """Median, mean and worst trial of each method and domain, tuned and as it comes."""
    rows = []
    for name in [*METHODS, *AS_THEY_COME]:
        cells = [name]
        for own in errors.values():
            loss = tuned(own)[name] if name in METHODS else own[name]
            deg = np.exp(np.median(loss, axis=0))
            cells.append(f"{np.median(deg):.2f} / {deg.mean():.2f} / {deg.max():.2f}")
        rows.append(cells)
    return markdown(["method", *(f"{DOMAINS[d]} (n = {own['constant'].shape[1]})" for d, own in errors.items())], rows)


def of_verdicts(errors: TiltErrors) -> str:
    """Each method against both comparators, domain by domain."""
    parts = []
    for domain, own in errors.items():
        losses = tuned(own)
        for comparator in COMPARATORS:
            found = tilt_verdicts(losses, comparator)
            head = [f"{DOMAINS[domain]}: against {comparator}", *VERDICT_HEADS]
            parts.append(markdown(head, [[name, *verdict_cells(verdict)] for name, verdict in found.items()]))
    return "\n\n".join(parts)


def verdict_cells(verdict: TiltVerdict) -> list[str]:
    """Return what stands below `VERDICT_HEADS`."""
    ratios = [f"{ratio:.2f} [{low:.2f}, {high:.2f}]" for ratio, low, high in (verdict.mean, verdict.median)]
    return [*ratios, f"{verdict.wins}/{verdict.n}", f"{verdict.p:.2g}", verdict.word]


def of_transfer(errors: TiltErrors) -> str:
    """How many times larger the error is with one setting for all recorded domains, and with that of another one."""
    domains = [domain for domain in RECORDED if domain in errors]
    pairs = [(source, domain) for domain in domains for source in domains if source != domain]
    rows = []
    for method in METHODS:
        loss = {domain: errors[domain][method] for domain in domains}
        own = {domain: scored(loss[domain], chosen(loss[domain])) for domain in domains}
        means = {domain: loss[domain].mean(axis=1) for domain in domains}
        cells = [method]
        for domain in domains:
            others = np.sum([means[d] for d in domains if d != domain], axis=0)
            cells.append(_times(scored(loss[domain], chosen(loss[domain], others)), own[domain]))
        for source, domain in pairs:
            best = [subset[means[source][subset].argmin()] for subset in tried()]
            cells.append(_times(loss[domain][best], own[domain]))
        rows.append(cells)
    heads = [*(f"all on {domain}" for domain in domains), *(f"{source} on {domain}" for source, domain in pairs)]
    return markdown(["method", *heads], rows)


def _times(loss: FloatArray, own: FloatArray) -> str:
    return f"{np.exp(np.median(loss - own, axis=0).mean()):.2f}"


def of_switches(errors: TiltErrors) -> str:
    """In which share of tunings and folds a switch is on."""
    rows = []
    for name, method in METHODS.items():
        settings = method.settings()
        for switch in method.switches:
            on = np.array([setting[switch] for setting in settings])
            rows.append([name, switch, *(f"{on[chosen(own[name])].mean():.2f}" for own in errors.values())])
    return markdown(["method", "switch", *errors], rows)


def of_luck(errors: TiltErrors) -> str:
    """Standard deviation over the tunings of the mean log error."""
    by_domain = [tuned(own) for own in errors.values()]
    rows = [[name, *(f"{own[name].mean(axis=1).std(ddof=1):.2f}" for own in by_domain)] for name in METHODS]
    return markdown(["method", *errors], rows)


TILT_TABLES: dict[str, Callable[[TiltErrors], str]] = {
    "errors": of_errors,
    "verdicts": of_verdicts,
    "transfer": of_transfer,
    "switches": of_switches,
    "luck": of_luck,
}
"""By their names on a page."""
