"""The identity of a plan's code: what a worker must have before it runs anything of the plan."""

import importlib
import socket
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from typing import Any

from jerkbench.jobs.job import Job
from jerkbench.jobs.key import code_digest, versions
from jerkbench.jobs.sources import plugin_digest
from jerkbench.plugins import is_own

SENT = ("audit", "jobs", "results", "suite", "tuning")
"""Rooms whose objects are sent to workers, besides those that compute."""


@dataclass(frozen=True, order=True)
class Foreign:
    """A plugin from elsewhere.

    Attributes:
        name: kind and name, for sentences.
        module: where its class is.
        qualname: what the class is called there.
        digest: hash of all that it depends on.
    """

    name: str
    module: str
    qualname: str
    digest: str


@dataclass(frozen=True)
class Identity:
    """The code, the versions of libraries and the plugins from elsewhere that a plan was made with.

    Attributes:
        code: hash of ours.
        versions: of the libraries.
        plugins: those from elsewhere.
    """

    code: str
    versions: tuple[tuple[str, str], ...]
    plugins: tuple[Foreign, ...] = ()


def identity_of(jobs: Iterable[Job]) -> Identity:
    """Return what a worker must have to run ``jobs``."""
    plugins = {foreign for job in jobs for part in job.parts() if (foreign := _foreign(*part)) is not None}
    return Identity(code_digest(*SENT), tuple(versions().items()), tuple(sorted(plugins)))


@cache
def worker_refusal(identity: Identity) -> str:
    """Return why this process may not run what belongs to ``identity``, or an empty string."""
    host = socket.gethostname()
    own = versions()
    differing = [
        f"{name} {own.get(name, 'missing')} for {wanted}"
        for name, wanted in identity.versions
        if own.get(name) != wanted
    ]
    if differing:
        return f"The worker on {host} has {', '.join(differing)}; install the plan's versions there."
    if identity.code != code_digest(*SENT):
        return (
            f"The worker on {host} has other code of jerkbench (hash {code_digest(*SENT)[:12]}) than the plan "
            f"({identity.code[:12]}); install the same there."
        )
    return next((sentence for foreign in identity.plugins if (sentence := _lacking(foreign, host))), "")


def _lacking(foreign: Foreign, host: str) -> str:
    """Say that a plugin is missing here, or is another."""
    try:
        cls: Any = importlib.import_module(foreign.module)
        for name in foreign.qualname.split("."):
            cls = getattr(cls, name)
    except Exception as error:  # noqa: BLE001 - whatever a third party's module raises
        return (
            f"The worker on {host} lacks the {foreign.name} ({foreign.module}): {type(error).__name__}: {error}. "
            "Install its package there as well."
        )
    if plugin_digest(cls) != foreign.digest:
        return f"The worker on {host} has another version of the {foreign.name} ({foreign.module}); install the same."
    return ""


def _foreign(kind: str, name: str, plugin: object) -> Foreign | None:
    cls: Any = type(plugin)
    return None if is_own(cls) else _of_class(f"{kind} {name}", cls)


@cache
def _of_class(name: str, cls: type) -> Foreign:
    return Foreign(name, cls.__module__, cls.__qualname__, plugin_digest(cls))
