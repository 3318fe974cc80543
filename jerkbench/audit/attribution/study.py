"""The folder of an attribution: its runs, the value of each corner, the shares, figure and page."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from jerkbench.arrays import FloatArray
from jerkbench.audit.attribution.campaign import AttributionRuns, corner_values
from jerkbench.audit.attribution.factors import ATTITUDES, FACTORS, methods_of, naive, naive_space
from jerkbench.audit.attribution.figure import waterfall
from jerkbench.audit.attribution.page import attribution_page
from jerkbench.audit.attribution.shapley import Corner
from jerkbench.audit.attribution.shares import Share, family_table, of_families, share_frame, shares
from jerkbench.audit.methods import space_of_method
from jerkbench.audit.protocol import AuditProtocol
from jerkbench.audit.scenarios import scenarios
from jerkbench.audit.stages import Stages
from jerkbench.cells.provenance import code_digest, git_commit, versions
from jerkbench.clusters.cluster import Cluster
from jerkbench.files import write_text
from jerkbench.report.plots.figures import save_figure


@dataclass(frozen=True)
class Attribution:
    """What an attribution found.

    Attributes:
        corners: (F, n) mean loss of each family and seed, at each corner.
        families: their names.
        shares: of each factor, the largest gain first, and the whole.
    """

    corners: Mapping[Corner, FloatArray]
    families: tuple[str, ...]
    shares: list[Share]


def run_attribution(
    protocol: AuditProtocol, folder: Path, cluster: Cluster, workers: int, *, only_stored: bool = False
) -> Attribution:
    """Run what is not stored in ``folder`` yet, and write the shares.

    Args:
        protocol: what is compared.
        folder: of the attribution.
        cluster: what runs it.
        workers: number of processes, where the cluster starts them.
        only_stored: run nothing, and take the rows that are stored, whatever code computed them.

    Raises:
        JerkbenchError: a run failed, or is not stored and may not be run.
        OSError: nothing can be written.
    """
    known, start = tuple(scenarios(protocol)), naive()
    methods = methods_of(protocol).values()
    spaces = {method: naive_space(space_of_method(method, known[0]), start) for method in methods}
    key = f"{code_digest('audit', 'tuning')} {sorted(versions().items())}"
    stages = {
        on: Stages(known, folder / "runs" / (name or "tilt"), key, cluster, workers, only_stored, name)
        for on, name in ATTITUDES.items()
    }
    scored = {on: AttributionRuns(protocol, spaces, own).scored() for on, own in stages.items()}
    values = corner_values(scored, protocol)
    families = [scenario.family for scenario in known]
    attribution = Attribution(
        {corner: of_families(own, families) for corner, own in values.items()},
        tuple(dict.fromkeys(families)),
        shares(values, families),
    )
    _write(attribution, protocol, folder, sorted({maker for own in stages.values() for maker in own.makers()}))
    return attribution


def corner_frame(attribution: Attribution) -> pd.DataFrame:
    """Return the mean loss of every corner and family, one a row: what the shares can be computed from again."""
    return pd.DataFrame(
        [
            {**{factor: factor in corner for factor in FACTORS}, "family": family, "log_rmse": float(np.mean(own))}
            for corner, values in attribution.corners.items()
            for family, own in zip(attribution.families, values, strict=True)
        ]
    )


def _write(attribution: Attribution, protocol: AuditProtocol, folder: Path, makers: list[str]) -> None:
    ends = [method.name for method in methods_of(protocol).values()]
    by_family = family_table(attribution.corners, attribution.families)
    texts = {
        "protocol.json": json.dumps({"digest": protocol.digest, **asdict(protocol)}, indent=1),
        "corners.csv": corner_frame(attribution).to_csv(index=False),
        "shares.csv": share_frame(attribution.shares).to_csv(index=False),
        "README.md": attribution_page(attribution.shares, by_family, protocol),
        "manifest.json": json.dumps({**_provenance(protocol), "rows_computed_by": makers}, indent=1),
    }
    for name, text in texts.items():
        write_text(folder / name, text)
    save_figure(waterfall(attribution.shares, f"naive {ends[0]}", f"tuned {ends[-1]}"), folder / "waterfall.png")


def _provenance(protocol: AuditProtocol) -> dict[str, object]:
    return {"protocol": protocol.digest, "code": code_digest(), "git_commit": git_commit(), "versions": versions()}
