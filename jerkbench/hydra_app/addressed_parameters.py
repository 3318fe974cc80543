"""Parameters under the name of their plugin (``adaptation.mtf.window=1,4``): they apply where that plugin is chosen."""

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

from hydra.core.config_loader import ConfigLoader
from hydra.core.override_parser.overrides_parser import OverridesParser
from omegaconf import DictConfig

from jerkbench import plugins
from jerkbench.cells.labels import GROUPS
from jerkbench.errors import PluginError
from jerkbench.hydra_app.composition import owner
from jerkbench.presets import default_names, preset_names

Job = Sequence[str]


class Address(NamedTuple):
    """What a word is about: ``GROUP.NAME.PARAMETER=VALUE``.

    Attributes:
        group: of the plugin.
        name: of the plugin, or of a preset.
        plain: the word without the name.
    """

    group: str
    name: str
    plain: str


def where_chosen(loader: ConfigLoader, config: DictConfig, jobs: Sequence[Job]) -> list[list[str]]:
    """Give addressed parameters to the jobs that choose their plugin; jobs that are then equal are one.

    Raises:
        PluginError: no job chooses the plugin of an address.
    """
    if not any(map(address, (word for job in jobs for word in job))):
        return [list(job) for job in jobs]

    @cache
    def chosen(choice: Job, group: str) -> frozenset[str]:
        """Return what the choice of a job means in ``group``: the preset and the plugin."""
        composed = loader.load_sweep_config(config, list(choice))
        return frozenset((str(composed.hydra.runtime.choices[group]), str(composed[group].name)))

    used: set[Address] = set()

    def fitting(job: Job) -> tuple[str, ...]:
        """Return the words of a job without those that are addressed to other plugins."""
        words = []
        for word in job:
            to = address(word)
            if to is None:
                words.append(word)
            elif to.name in chosen(_choice(job, to.group), to.group):
                words.append(to.plain)
                used.add(to._replace(plain=""))
        return tuple(words)

    fitted = list(dict.fromkeys(map(fitting, jobs)))
    for to in dict.fromkeys(filter(None, (address(word) for job in jobs for word in job))):
        if to._replace(plain="") not in used:
            raise PluginError(_nowhere(to))
    return [list(job) for job in fitted]


def swept_addresses(words: Sequence[str]) -> list[str]:
    """Return the words of a sweep, each parameter that not all jobs have, and that has one value, as a sweep over it.

    What is no sweep Hydra puts into the configuration of all jobs, most of which have no place for it.
    """
    varies = any(_is_sweep(word) for word in words if word.startswith("disturbance="))
    parameters = {word for word in words if address(word) or (varies and _of_disturbance(word))}
    return [_as_choice(word) if word in parameters and not _is_sweep(word) else word for word in words]


def _is_sweep(word: str) -> bool:
    return OverridesParser.create().parse_override(word).is_sweep_override()


def _of_disturbance(word: str) -> bool:
    return word.startswith("disturbance.") and "=" in word


def _as_choice(word: str) -> str:
    key, _, value = word.partition("=")
    return f"{key}=choice({value})"


def without_addresses(words: Sequence[str]) -> list[str]:
    """Return the words of a single run, addressed parameters without the names of their plugins.

    Raises:
        PluginError: the run has another plugin.
    """
    fitted = []
    for word in words:
        to = address(word)
        if to is not None and _typed(words, to.group) != to.name:
            raise PluginError(_nowhere(to))
        fitted.append(word if to is None else to.plain)
    return fitted


def address(word: str) -> Address | None:
    """Read a word; None: it has no address."""
    key, sign, value = word.partition("=")
    parts = key.split(".")
    if not sign or len(parts) < 3 or parts[0] not in GROUPS:
        return None
    group, name, *parameter = parts
    if name not in plugins.names(group) and name not in preset_names(group):
        return None
    return Address(group, name, f"{group}.{'.'.join(parameter)}={value}")


def _choice(job: Job, group: str) -> tuple[str, ...]:
    """The words that decide which plugin of a group there is."""
    return tuple(w for w in job if owner(w) in ("experiment", "dataset", group) and "." not in w.partition("=")[0])


def _typed(words: Sequence[str], group: str) -> str:
    typed = [word.partition("=")[2] for word in words if word.startswith(f"{group}=")]
    return typed[-1] if typed else default_names()[group]


def _nowhere(to: Address) -> str:
    return (
        f"{to.group}.{to.name}...: nothing that is to run has {to.group}={to.name}; choose it too, or leave that out."
    )
