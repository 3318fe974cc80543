"""Random command lines from the grammar of jerkbench: commands, groups, plugins, parameters, and invalid values."""

import dataclasses
import random
from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

from jerkbench import plugins
from jerkbench.hydra_app.configuration import Schema
from jerkbench.jobs.job import Noise
from jerkbench.presets import preset_files
from jerkbench.report.labels import GROUPS

T = TypeVar("T")

SHORT = ("dataset.duration_s=9", "seeds=1", "figures=false", "workers=1", "engine=filterpy")
"""Arguments of a run that takes a fraction of a second and does not compile a filter."""

HOSTILE = (
    *("", "null", "???", "nan", "inf", "-inf", "-1", "0", "1e308", "99999999999999999999", "true", "[]", "{}", "[[]]"),
    *(
        "[null]",
        "[[all]]",
        "{a:1}",
        "'",
        '"',
        "a b",
        "ä€",
        "\x1b[31m",
        "..",
        "/proc/x",
        "x" * 300,
        "${seeds}",
        "${nope}",
    ),
    *("${oc.env:NOPE}", "1,2", "none,null", "range(1,3)", "range(1,3,0)", "range(.1,.4,.1)", "range(3,1)", "a,b"),
    *("1,1.5", "1,abc", "true,1", "1,11", "=1+1", "a\u2028b", "<script>", "![a](b)", ",", "?", "2147483648"),
    *("interval(0,1)", "glob(*)", "choice(1,2)", "sort(2,1)", "shuffle(1,2)", "[1,2", "(", "\\", "0x10", "1_0", ".5"),
)
"""Values that are invalid for most parameters."""

FLAGS = (
    *(["-m"], ["--multirun"], ["--cfg", "job"], ["--cfg", "hydra"], ["--cfg", "all", "--resolve"], ["--resolve"]),
    *(["--cfg", "job", "--package", "filter"], ["--cfg", "job", "-p", "nope"], ["--info", "config"], ["--info", "all"]),
    *(
        ["--info", "defaults-tree"],
        ["--info", "nope"],
        ["--config-name", "nope"],
        ["--config-name", "filter/baseline_untuned"],
    ),
    *(
        ["--config-dir", "nope"],
        ["--config-dir", "."],
        ["--config-path", "nope"],
        ["--shell-completion"],
        ["-sc", "query=fish"],
    ),
    *(
        ["--hydra-help"],
        ["--help"],
        ["--version"],
        ["--experimental-rerun", "nope"],
        ["--nope"],
        ["--run"],
        ["--run", "-m"],
    ),
)

HYDRA = (
    *(
        "hydra.run.dir=/proc/x",
        "hydra.sweep.dir=/proc/x",
        "hydra.sweep.dir=null",
        "hydra.mode=RUN",
        "hydra.mode=MULTIRUN",
    ),
    *("hydra.mode=NOPE", "hydra/launcher=basic", "hydra/launcher=joblib", "hydra/launcher=nope", "hydra/sweeper=basic"),
    *(
        "hydra/sweeper=nope",
        "hydra.verbose=true",
        "hydra.job.chdir=true",
        "hydra.output_subdir=x",
        "hydra.nope=1",
        "~hydra",
    ),
    *(
        "hydra.sweeper.max_batch_size=0",
        "hydra.sweeper.max_batch_size=1",
        "hydra.sweeper.params=null",
        "hydra.job.name=x",
    ),
    *("hydra.searchpath=[nope]", "hydra.searchpath=3", "hydra.job.num=x", "hydra.sweep.subdir=null", "hydra.run=null"),
)


class CommandLines:
    """A reproducible stream of random command lines.

    Args:
        seed: seed of the random numbers.
        study: folder of an undamaged study, for the commands that read a study.
    """

    def __init__(self, seed: int, study: Path) -> None:
        """Seed the random numbers."""
        self._random, self._study = random.Random(seed), str(study)  # noqa: S311 - not for cryptography

    def run(self) -> list[str]:
        """Return a command line of `jerkbench run`."""
        words = [self._override() for _ in range(self._random.randint(0, 4))]
        words += [self._one(FLAGS)] if self._happens(0.3) else []
        words += [[self._one(HYDRA)]] if self._happens(0.15) else []
        words += [["-m"]] if self._happens(0.4) else []
        self._random.shuffle(words)
        return ["run", *SHORT, *(self._damaged(word) for group in words for word in group)]

    def other(self) -> list[str]:
        """Return a command line of another command."""
        make = self._one((self._catalogue, self._table, self._compare, self._row, self._report, self._data, self._junk))
        return [self._damaged(word) for word in make()]

    def _override(self) -> list[str]:
        make = self._one((self._choice, self._choice, self._parameter, self._parameter, self._option, self._noise))
        *chosen, last = make()
        return [*chosen, f"{self._one(('', '', '', '', '', '', '+', '++', '~'))}{last}"]

    def _choice(self) -> list[str]:
        group = self._one((*GROUPS, "disturbance", "noise"))
        known = self._known(group)
        value = self._one(
            (self._one(known), self._one(known), f"[{self._one(known)}]", self._several(known), self._hostile())
        )
        return [f"{group}={value}"]

    def _parameter(self) -> list[str]:
        kind = self._one(("filter", "adaptation", "attitude", "dataset", "disturbance"))
        name = self._one(plugins.names(kind))
        fields = [f.name for f in dataclasses.fields(plugins.get(kind, name))] or ["name"]
        owner = f"{kind}.{name}" if kind == "disturbance" else kind
        chosen = [f"{kind}={name}"] if self._happens(0.7) else []
        return [*chosen, f"{owner}.{self._one(fields)}={self._value()}"]

    def _option(self) -> list[str]:
        return [f"{self._one([f.name for f in dataclasses.fields(Schema)])}={self._value()}"]

    def _noise(self) -> list[str]:
        return [f"noise.{self._one([f.name for f in dataclasses.fields(Noise)])}={self._value()}"]

    def _catalogue(self) -> list[str]:
        kind = self._one((*plugins.KINDS, "noise", "experiment", self._hostile()))
        known = self._known(kind) if kind in (*plugins.KINDS, "noise", "experiment") else ["x"]
        return self._one(
            (
                ["list"],
                ["help"],
                ["help", "run"],
                ["show", self._one(known or ["x"])],
                ["list", kind],
                ["show", kind, self._one((*known, self._hostile()))],
                ["show", kind],
            )
        )

    def _table(self) -> list[str]:
        options = {
            "--metric": ("position_rmse_m", "status", "seed", "nope"),
            "--rows": ("filter", "noise,filter", "nope", ",", "filter,filter"),
            "--columns": ("adaptation", "filter", "nope", ""),
            "--baseline": ("adaptation=none", "filter=nope", "nope=1", "=", "adaptation"),
            "--format": ("md", "csv", "tex", "html", "terminal", "nope"),
        }
        asked = [
            word for option in self._random.sample(list(options), 2) for word in (option, self._one(options[option]))
        ]
        return ["table", self._folder(), *asked, *(["--findings"] if self._happens(0.2) else [])]

    def _compare(self) -> list[str]:
        above = self._one(([], ["--fail-above", self._hostile()], ["--metric", self._hostile()], ["--fail-above", "3"]))
        return ["compare", self._folder(), self._folder(), *above]

    def _row(self) -> list[str]:
        row = self._one(("1", "0", "-1", "99", "x:0", ":", self._hostile()))
        return self._one(
            (
                ["rerun", self._folder(), row],
                ["export", self._folder(), row, "--tum", self._one(("out", "", "/proc/x"))],
            )
        )

    def _report(self) -> list[str]:
        verb = self._one(("report", "figures"))
        out = self._one(([], ["--out", ""], ["--out", "/proc/x/y"], ["--out", "."], ["--out", "made.html"]))
        if verb == "figures":  # drawing takes long
            return [verb, "nowhere", *out]
        return [verb, self._folder(), "--scenarios", self._one(("0", "0", "-1", "x")), *out]

    def _data(self) -> list[str]:
        source = self._one(("field", "rtklib", "nope.bag", ".", "", "/proc/x", self._hostile()))
        given = [
            "--set",
            "duration_s=9",
            self._one(
                ("imu_rate_hz=nan", "nope=1", "x", "=", "gnss_rate_hz=5", "stand_s=3", "height_m=,", "height_m=[1")
            ),
        ]
        seed = ["--seed", self._one(("0", "3", "-1", "x", "99999999999999999999"))]
        return self._one(
            (
                ["data", "inspect", source, *given, *seed],
                ["data", "convert", source, self._one(("a.csv", "a.bag", "a.x", "", "/proc/x/a.csv")), *given, *seed],
                ["data", "fetch", self._one(("nope", ""))],
                ["data", "fetch"],
                ["data", "cache"],
                ["data"],
            )
        )

    def _junk(self) -> list[str]:
        return [self._hostile() for _ in range(self._random.randint(0, 3))]

    def _folder(self) -> str:
        return self._one((self._study, self._study, self._study, "nowhere", "", "/proc", "."))

    def _known(self, kind: str) -> list[str]:
        return [*(plugins.names(kind) if kind in plugins.KINDS else ()), *preset_files(kind)]

    def _several(self, known: Sequence[str]) -> str:
        return self._one((",".join, lambda names: f"[{','.join(names)}]"))(
            self._random.sample(known, min(2, len(known)))
        )

    def _value(self) -> str:
        return self._one((self._hostile(), self._one(("1", "2", "0.5", "true", "none", "[1,2]", "[[5,6]]", "abc"))))

    def _hostile(self) -> str:
        return self._one(HOSTILE)

    def _damaged(self, word: str) -> str:
        """Return ``word``; with probability 5 %, delete or insert a character, or double the end of the word."""
        if word.startswith(self._study) or not word or self._happens(0.95):
            return word
        at = self._random.randrange(len(word))
        return self._one(
            (word[:at] + word[at + 1 :], word[:at] + self._one("=.,[]{}'~+@:/ ") + word[at:], word + word[at:])
        )

    def _happens(self, share: float) -> bool:
        return self._random.random() < share

    def _one(self, choices: Sequence[T]) -> T:
        return self._random.choice(choices)
