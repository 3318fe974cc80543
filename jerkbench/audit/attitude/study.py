"""The folder of an audit of attitude filters: its rows, its tables, and what it was made with."""

import json
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

import pandas as pd

from jerkbench.attitude.vqf import vqf_package
from jerkbench.audit.attitude.methods import TILT_METHODS, TILT_SETTINGS
from jerkbench.audit.attitude.rows import COMPUTED_BY, audit_rows
from jerkbench.audit.attitude.trials import DOMAINS, TiltTrial, all_trials
from jerkbench.audit.attitude.verdicts import (
    COMPARATORS,
    TILT_TABLES,
    TRIED_EACH,
    TUNINGS,
    errors_of,
    tilt_verdicts,
    tuned,
)
from jerkbench.files import write_atomically, write_text
from jerkbench.jobs.key import code_digest, git_commit, versions

TILT_ERRORS = "errors.parquet"

TILT_PAGE = """\
# Attitude filters: the error of the tilt, domain by domain

{answer}

Each of {methods} methods has {settings} settings from its own ranges, and is tuned {tunings} times, each time with
{each} of them and without the trial that is scored. The value of a trial is the median over the tunings. Domains are
not pooled. Verdicts: sign test over trials, corrected with Holm's method over the methods. The authors of VQF tuned its
defaults on BROAD. `offline_vqf` is a smoother: it is shown and never ranked. {absent}

## Errors of the inclination [deg]: median / mean / worst trial

{errors}

## Verdicts: ratios of errors

{verdicts}

## One setting for all recorded domains, and one from elsewhere: times the error of the domain's own

{transfer}

## Share of tunings with a switch on

{switches}

## Standard deviation over the tunings of the mean log error

{luck}
"""


def run_attitude_audit(data: Path, folder: Path, workers: int, settings: int = TILT_SETTINGS) -> str:
    """Compute what is not kept yet, write rows, tables and manifest to ``folder``, and return the answer.

    Args:
        data: holds broad, repoimu and kitti; a domain whose files are not there is left out.
        folder: of the audit.
        workers: processes.
        settings: how many of each method are run; fewer than all give rows and no tables.

    Raises:
        JerkbenchError: the package vqf is not installed, or a recording is damaged.
    """
    vqf_package()
    trials = list(all_trials(data))
    rows = audit_rows(trials, folder / "rows", workers, settings)
    write_atomically(folder / TILT_ERRORS, lambda path: rows.to_parquet(path, index=False))
    write_text(folder / "manifest.json", json.dumps(_manifest(trials, settings), indent=1) + "\n")
    if settings < TILT_SETTINGS:
        return f"{len(rows)} rows of {len(trials)} trials."
    answer, page = attitude_answer(rows), attitude_audit_page(rows)
    write_text(folder / "README.md", page)
    return answer


def attitude_answer(rows: pd.DataFrame) -> str:
    """Return who is better and who is worse than each comparator, a line for each domain."""
    lines = []
    for domain, own in errors_of(rows).items():
        parts = []
        for comparator in COMPARATORS:
            found = tilt_verdicts(tuned(own), comparator)
            words = {word: [name for name, of in found.items() if of.word == word] for word in ("better", "worse")}
            said = [f"{', '.join(names)} {word}" for word, names in words.items() if names]
            parts.append(f"Against {comparator} {'; '.join(said) or 'nobody is shown better or worse'}")
        lines.append(f"- {DOMAINS[domain]} (n = {own['constant'].shape[1]}): {'. '.join(parts)}.")
    return "\n".join(lines)


def attitude_audit_page(rows: pd.DataFrame) -> str:
    """Return the page with all tables."""
    errors = errors_of(rows)
    absent = [title for domain, title in DOMAINS.items() if domain not in errors]
    return TILT_PAGE.format(
        answer=attitude_answer(rows),
        methods=len(TILT_METHODS),
        settings=TILT_SETTINGS,
        tunings=TUNINGS,
        each=TRIED_EACH,
        absent=f"Not here, and left out: {'; '.join(absent)}." if absent else "",
        **{name: table(errors) for name, table in TILT_TABLES.items()},
    )


def _manifest(trials: Sequence[TiltTrial], settings: int) -> dict[str, object]:
    return {
        "code": code_digest(*COMPUTED_BY),
        "git_commit": git_commit(),
        "versions": {**versions(), "vqf": version("vqf")},
        "trials": {f"{trial.domain} {trial.name}": trial.fingerprint for trial in trials},
        "settings": {name: method.settings()[:settings] for name, method in TILT_METHODS.items()},
    }
