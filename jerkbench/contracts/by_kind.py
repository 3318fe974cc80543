"""The contract and the optional parts of each kind of plugin."""

from collections.abc import Mapping

from jerkbench.contracts.adaptation import Adaptation, Clocked, Remembering, RememberingStates, TrueCovariance
from jerkbench.contracts.attitude import AttitudeFilter
from jerkbench.contracts.dataset import Dataset, PreferringAttitude, WithoutImu
from jerkbench.contracts.disturbance import Disturbance
from jerkbench.contracts.engine import Engine, Preparing, SideBySide
from jerkbench.contracts.estimator import Batched, Estimator, PerSeed
from jerkbench.contracts.filter import Filter, Labelled, ManyLengths, UsingImu
from jerkbench.contracts.metric import Metric, OnRequest, Reading, Summarising
from jerkbench.contracts.prior_and_gain import AdaptingGain, AdaptingPrior, Fading
from jerkbench.contracts.shared import AttitudeOnly, Cited, Depending, ReadingFile, Remarking, Requiring

OPTIONAL: Mapping[str, tuple[type, ...]] = {
    "dataset": (PreferringAttitude, AttitudeOnly, WithoutImu, Cited, Depending),
    "disturbance": (ReadingFile, Cited, Depending),
    "attitude": (Requiring, Remarking, Cited, Depending),
    "filter": (
        ManyLengths,
        Batched,
        UsingImu,
        AttitudeOnly,
        Requiring,
        PerSeed,
        Labelled,
        ReadingFile,
        Remarking,
        Cited,
        Depending,
    ),
    "adaptation": (
        Remembering,
        RememberingStates,
        Fading,
        AdaptingPrior,
        AdaptingGain,
        Clocked,
        TrueCovariance,
        Cited,
        Depending,
    ),
    "engine": (SideBySide, Preparing, Cited, Depending),
    "metric": (Summarising, Reading, OnRequest, Cited, Depending),
}
"""The optional parts of each kind; a new one is a Protocol beside its contract, and a word here."""

REQUIRED: Mapping[str, tuple[type, ...]] = {
    "dataset": (Dataset,),
    "disturbance": (Disturbance,),
    "attitude": (AttitudeFilter,),
    "filter": (Filter, Estimator),
    "adaptation": (Adaptation,),
    "engine": (Engine,),
    "metric": (Metric,),
}
"""The contract of each kind; a filter has one of two."""
