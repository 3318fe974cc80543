"""Where the presets are."""

from pathlib import Path


def config_folder() -> Path:
    """The presets: conf/ of a checkout, or the copy that an installed package carries."""
    package = Path(__file__).parent
    beside, inside = package.parent / "conf", package / "conf"
    return beside if (beside / "config.yaml").is_file() else inside
