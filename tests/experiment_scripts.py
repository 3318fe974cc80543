"""The scripts of experiments/, as modules."""

import sys
from importlib import import_module
from pathlib import Path

EXPERIMENTS = Path(__file__).parents[1] / "experiments"


def experiment(script):
    """Import a script by its path below experiments/, and what lies beside it, as its own command line does."""
    path = EXPERIMENTS / script
    if str(path.parent) not in sys.path:
        sys.path.append(str(path.parent))
    return import_module(path.stem)
