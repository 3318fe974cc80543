"""The contracts of the plugins, kind by kind. A plugin need not inherit from these; it only has to fit.

`dataset`, `disturbance`, `attitude`, `filter` (kinematic), `estimator` (any other filter), `adaptation`, `engine` and
`metric` each hold the contract of one kind, and behind it its optional parts, each a Protocol of its own. Those of an
adaptation that changes more than R stand in `prior_and_gain`, those that several kinds may have in `shared`. `by_kind`
lists contracts and optional parts. A plugin that has an optional part is asked for it; one whose part is misspelt is
refused when it is registered.

All names are there to be imported from here: ``from jerkbench.contracts import Adaptation``.
"""

from jerkbench.contracts.adaptation import Adaptation, Clocked, Remembering, RememberingStates, TrueCovariance
from jerkbench.contracts.attitude import AttitudeFilter
from jerkbench.contracts.by_kind import OPTIONAL, REQUIRED
from jerkbench.contracts.dataset import Dataset, PreferringAttitude, WithoutImu
from jerkbench.contracts.disturbance import Disturbance
from jerkbench.contracts.engine import Engine, Preparing, SideBySide
from jerkbench.contracts.estimator import Batched, Estimator, PerSeed
from jerkbench.contracts.filter import Filter, Labelled, ManyLengths, UsingImu
from jerkbench.contracts.methods import has_methods
from jerkbench.contracts.metric import Metric, OnRequest, Reading, Summarising
from jerkbench.contracts.prior_and_gain import AdaptingGain, AdaptingPrior, Fading
from jerkbench.contracts.shared import AttitudeOnly, Cited, Depending, ReadingFile, Remarking, Requiring

__all__ = [
    "OPTIONAL",
    "REQUIRED",
    "Adaptation",
    "AdaptingGain",
    "AdaptingPrior",
    "AttitudeFilter",
    "AttitudeOnly",
    "Batched",
    "Cited",
    "Clocked",
    "Dataset",
    "Depending",
    "Disturbance",
    "Engine",
    "Estimator",
    "Fading",
    "Filter",
    "Labelled",
    "ManyLengths",
    "Metric",
    "OnRequest",
    "PerSeed",
    "PreferringAttitude",
    "Preparing",
    "Reading",
    "ReadingFile",
    "Remarking",
    "Remembering",
    "RememberingStates",
    "Requiring",
    "SideBySide",
    "Summarising",
    "TrueCovariance",
    "UsingImu",
    "WithoutImu",
    "has_methods",
]
