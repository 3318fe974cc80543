"""`jerkbench tune`: the best setting of each method, found on some runs and scored on others."""

import argparse

from jerkbench.verbs.arguments import Verbs, add_verb

EPILOG = """\
KEY=VALUE are those of `jerkbench run`. Several values, separated by commas, of dataset, disturbance and attitude are
the scenarios of one tuning; several of filter and adaptation are methods, each tuned with the same budget (-m).

  jerkbench tune filter=jerk adaptation=mtf disturbance=none,noise_step trials=64
  jerkbench tune -m filter=baseline,jerk adaptation=none,mtf,chi2 disturbance=none,outliers study=alike
  jerkbench tune filter=bias dataset=husky_bag dataset.folder=DIR objective=likelihood      one's own log, no reference

What is tuned: every parameter with a range (`jerkbench show filter jerk`), and what the filter is told of the reported
R (r_scale.position, r_scale.velocity); knobs=[filter.accel_mps2,...] names fewer.

  trials=64            settings that are tried, the one before the search among them
  sampler=sobol        sobol (for comparisons), tpe, cma_es (the extra `tune`); sampler_seed=1: another scramble
  objective=rmse       rmse: log of the ratio to the plain filter at its defaults, a lost run counts log 100;
                       likelihood: of the innovations, without a reference
  split=auto           seeds; time (share=0.5: tuned on the first half, tested on the second);
                       recordings, families (held_out=[NAME,...]: tested on these, tuned without them)
  tune_seeds=16 choose_seeds=16 test_seeds=40 first_seed=0      disjoint; the test seeds are read at the end
  finalists=8          the best, tried again on the seeds to choose on
  restarts=1           more searches with other scrambles: their spread is luck
  cluster=local        threads of this process; dask, slurm, ...: each scenario goes to a worker (docs/cluster.md)

Written to results/STUDY/tune/METHOD: tuning.md, presets for `jerkbench run --config-dir`, settings for
robot_localization, KF-GINS and eskf15, every trial. The same command goes on where it was stopped.
"""


def add(verbs: Verbs) -> None:
    """Declare the verb."""
    tune = add_verb(verbs, "tune", "find the best setting of a method, and score it on runs that were not seen", answer)
    tune.formatter_class = argparse.RawDescriptionHelpFormatter
    tune.epilog = EPILOG
    tune.add_argument("-m", "--multirun", action="store_true", help="tune each of several methods, with equal budgets")
    tune.add_argument("words", nargs="*", metavar="KEY=VALUE", help="what to tune, on what, with which budget")


def answer(chosen: argparse.Namespace) -> None:
    """Tune, print what came out, and write it.

    Raises:
        JerkbenchError: a word is unknown, or what it asks for cannot be tuned.
    """
    from jerkbench.hydra_app.tuning import tune_all
    from jerkbench.hydra_app.tuning_words import told_apart

    tune_all(told_apart(chosen.words, several=chosen.multirun))
