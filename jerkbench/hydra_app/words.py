"""The words of `jerkbench run` where another verb takes them: the cell, and the options, that they describe."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from omegaconf import DictConfig, OmegaConf

from jerkbench.cells.cell import Cell
from jerkbench.errors import JerkbenchError
from jerkbench.hydra_app.configuration import cell_of, register_schemas
from jerkbench.hydra_app.hydra_parts import register_hydra_parts
from jerkbench.hydra_app.messages import sentence
from jerkbench.hydra_app.options import check_options
from jerkbench.presets import config_folder


@dataclass(frozen=True, eq=False)
class Words:
    """What words of the form KEY=VALUE describe.

    Attributes:
        config: the configuration, composed as `jerkbench run` does.
        choices: the name that was chosen for each group.
        overrides: the words.
    """

    config: DictConfig
    choices: dict[str, Any]
    overrides: list[str]

    def cell(self, **filter_parameters: object) -> Cell:
        """Return the cell.

        Args:
            filter_parameters: what is set beside the words, without Hydra's rules for quotation marks.

        Raises:
            PluginError: something is unknown or does not fit together.
        """
        plain: Any = OmegaConf.to_container(self.config, resolve=True)
        plain["filter"] = {**plain["filter"], **filter_parameters}
        return cell_of(plain, self.choices, self.overrides)


def composed(words: Sequence[str]) -> Words:
    """Compose the configuration that ``words`` ask for.

    Raises:
        JerkbenchError: one of them is unknown or has a wrong type, or an option makes no sense.
    """
    from hydra import compose, initialize_config_dir
    from hydra.errors import HydraException
    from omegaconf.errors import OmegaConfBaseException

    from jerkbench.hydra_app.arguments import arranged_words

    overrides = arranged_words(words)
    register_schemas()
    register_hydra_parts()
    try:
        with initialize_config_dir(str(config_folder()), version_base="1.3"):
            whole = compose("config", overrides, return_hydra_config=True)
        choices: Any = OmegaConf.to_container(whole.hydra.runtime.choices)
        config = OmegaConf.masked_copy(whole, [str(key) for key in whole if key != "hydra"])
        check_options(config)
    except (HydraException, OmegaConfBaseException) as error:
        raise JerkbenchError(sentence(error, list(words))) from error
    return Words(config, choices, overrides)
