"""Every number of an audit's page from its rows alone, in pandas."""

import numpy as np
import pandas as pd

METHOD = ["filter", "adaptation"]


def recomputed(folder_or_rows, protocol):
    """Return numbers by name, from the tables drives, judged and tuned."""
    drives, judged, tuned = (getattr(folder_or_rows, name) for name in ("drives", "judged", "tuned"))
    judged = judged.assign(method=judged["filter"].astype(str) + " + " + judged["adaptation"].astype(str))
    judged["loss"] = (
        judged["log_error"].astype(float).fillna(judged["seed"].map(drives.set_index("seed")["level"]) + np.log(100))
    )
    tuned = tuned.assign(method=tuned["filter"].astype(str) + " + " + tuned["adaptation"].astype(str))
    plain = [f"{model} + none" for model in protocol.filters]
    methods = [f"{model} + {name}" for model in protocol.filters for name in protocol.compared]
    cube = judged[judged["tried"] > 1].pivot_table(index=["tried", "tuning", "seed"], columns="method", values="loss")
    narrow, wide = cube.loc[protocol.trials], cube.loc[protocol.plain_trials]
    lowest = tuned[tuned["trial"] < protocol.trials].pivot_table(
        index="tuning", columns="method", values="loss", aggfunc="min"
    )
    widest = tuned[tuned["method"].isin(plain)].pivot_table(
        index="tuning", columns="method", values="loss", aggfunc="min"
    )
    published = [m for m in methods if protocol.adaptations[m.split(" + ")[1]] != "own"]
    best = pd.concat(
        [narrow.xs(r, level="tuning", drop_level=False)[lowest.loc[r, plain].idxmin()] for r in lowest.index]
    )
    pick = pd.concat(
        [narrow.xs(r, level="tuning", drop_level=False)[lowest.loc[r, published].idxmin()] for r in lowest.index]
    )
    with_more = pd.concat([wide.xs(r, level="tuning", drop_level=False)[widest.loc[r].idxmin()] for r in widest.index])
    own = pd.DataFrame({m: narrow[m] - narrow[f"{m.split(' + ')[0]} + none"] for m in methods})
    faults = drives.set_index("seed").filter(like="drawn.fault.").notna().rename(columns=lambda name: name[12:])
    drive = own.groupby("seed").mean()
    kinds = {"no fault": ~faults.any(axis=1), **{kind: faults[kind] for kind in faults}}
    by_kind = {kind: np.exp(drive[member.reindex(drive.index)].mean()) for kind, member in kinds.items()}
    at_defaults = judged[judged["tried"] == 1].pivot_table(index="seed", columns="method", values="loss").mean()
    price, gain = (drive[kinds["no fault"].reindex(drive.index) == none].mean() for none in (True, False))
    return {
        "own_ratio": np.exp(own.mean()),
        "best_ratio": np.exp((narrow[methods].sub(best, axis=0)).mean()),
        "average": np.exp(own[published].mean().mean()),
        "pick": np.exp((pick - with_more).mean()),
        "untuned": np.exp(
            pd.Series({m: at_defaults[m] - narrow[f"{m.split(' + ')[0]} + none"].mean() for m in methods})
        ),
        "worse_3": (drive > np.log(1.03)).mean(),
        "worse_100": (drive > np.log(2)).mean(),
        "lost": judged[judged["tried"] == protocol.trials]
        .groupby("method")["log_error"]
        .apply(lambda e: e.isna().mean())[methods],
        "pays_from": (price.clip(lower=0) / (price.clip(lower=0) - gain)).where(gain < 0),
        "kinds": pd.DataFrame(by_kind),
    }
