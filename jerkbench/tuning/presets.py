"""The tuned setting as presets that any run takes: `jerkbench run --config-dir FOLDER experiment=NAME`."""

from pathlib import Path
from typing import Any

from omegaconf import OmegaConf

from jerkbench.files import write_text
from jerkbench.tuning.outcome import Tuning

PARTS = ("filter", "adaptation")


def preset_words(tuning: Tuning, *, typed: bool) -> list[str]:
    """Return the words that choose what was tuned.

    Args:
        tuning: the tuned method.
        typed: whether the words of the tuning choose an experiment themselves; a run takes one only.
    """
    if not typed:
        return [f"experiment={_name(tuning)}"]
    spec, setting = tuning.cases.tune[0].cell.spec, tuning.setting
    parts = [f"{part}={spec[part]['name']}_tuned" for part in PARTS if tuning.space.of_part(part, setting)]
    return parts + [f"r_scale.{key}={value}" for key, value in tuning.space.of_part("r_scale", setting).items()]


def write_presets(tuning: Tuning, folder: Path, remarks: str) -> None:
    """Write a preset of each part that was tuned, and an experiment that chooses them.

    Args:
        tuning: the tuned method.
        folder: below which the groups are.
        remarks: what stands at the top of each file, one line.
    """
    cell = tuning.cases.tune[0].cell
    chosen = {}
    for part in PARTS:
        plugin, values = str(cell.spec[part]["name"]), tuning.space.of_part(part, tuning.setting)
        chosen[part] = f"{plugin}_tuned" if values else plugin
        if values:
            kept = {**_given(cell.spec[part]), **values}
            write_text(folder / part / f"{plugin}_tuned.yaml", _text(remarks, {"defaults": [plugin, "_self_"], **kept}))
    told = tuning.space.of_part("r_scale", tuning.setting)
    defaults = [{f"override /{part}": preset} for part, preset in chosen.items()]
    whole = {"defaults": [*defaults, "_self_"], **({"r_scale": told} if told else {})}
    write_text(folder / "experiment" / f"{_name(tuning)}.yaml", f"# @package _global_\n{_text(remarks, whole)}")


def _name(tuning: Tuning) -> str:
    """The name of the experiment."""
    return f"{tuning.name}_tuned".replace("-", "_")


def _given(spec: dict[str, Any]) -> dict[str, Any]:
    """The parameters of a part, without its name."""
    return {key: list(value) if isinstance(value, tuple) else value for key, value in spec.items() if key != "name"}


def _text(remarks: str, content: dict[str, Any]) -> str:
    return f"# {remarks}\n{OmegaConf.to_yaml(OmegaConf.create(content))}"
