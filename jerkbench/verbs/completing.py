"""`jerkbench completion`: the script by which a shell completes words, and the answer to what it asks."""

import argparse
import dataclasses
from collections.abc import Iterator, Sequence

from jerkbench.presets import preset_names, take_folders
from jerkbench.verbs.arguments import argument, verb

# Where readline cuts words at =, what stands before it is not to be given again.
BASH = """\
_jerkbench() {
    local line="${COMP_LINE:0:$COMP_POINT}" word
    word="${line##* }"
    COMPREPLY=($(jerkbench completion bash --line "$line" 2>/dev/null))
    [[ "${COMPREPLY[0]}" == *[=.] ]] && compopt -o nospace 2>/dev/null
    [[ -n "$BASH_VERSION" && "$word" == *=* ]] && COMPREPLY=("${COMPREPLY[@]#"${word%%=*}="}")
}
complete -o default -F _jerkbench jerkbench
"""
FISH = "complete -c jerkbench -a '(jerkbench completion fish --line (commandline -cp) 2>/dev/null)'\n"
_SCRIPTS = {"bash": BASH, "fish": FISH, "zsh": f"autoload -U +X bashcompinit && bashcompinit\n{BASH}"}
HEADS = {
    "bash": 'In ~/.bashrc: eval "$(jerkbench completion bash)"',
    "fish": "In ~/.config/fish/config.fish: jerkbench completion fish | source",
    "zsh": 'In ~/.zshrc, behind compinit: eval "$(jerkbench completion zsh)"',
}

CHOSEN_GROUPS = (
    *("dataset", "disturbance", "attitude", "filter", "adaptation", "noise", "engine", "experiment", "cluster"),
)
"""The groups of which a name is chosen: GROUP=NAME."""

_OTHERS = (
    *("seeds", "first_seed", "study", "results", "metrics", "workers", "figures", "figures_pdf", "report"),
    *("burn_in_s", "divergence_limit_m", "notes", "r_scale.position", "r_scale.velocity"),
)
"""The other words of `jerkbench run` that take a value."""


@verb(
    argument("shell", choices=tuple(_SCRIPTS), help="whose words are to be completed"),
    argument("--line", help=argparse.SUPPRESS),
)
def completion_verb(chosen: argparse.Namespace) -> None:
    """Print the script that completes verbs, options, plugins and parameters in bash, zsh or fish.

    Its first line says where it goes.

      jerkbench completion bash
      jerkbench completion zsh
    """
    if chosen.line is None:
        print(f"# {HEADS[chosen.shell]}\n{_SCRIPTS[chosen.shell]}", end="")
        return
    for word in completions(chosen.line):
        print(word)


def completions(line: str) -> list[str]:
    """Return the words that may stand where ``line`` ends; none where any file may stand.

    >>> completions("jerkbench data fe")
    ['fetch']
    """
    _, *words = line.split() if line.strip() else [""]
    current = words.pop() if words and not line.endswith(" ") else ""
    words = take_folders(words)
    return sorted({word for word in _possible(words, current) if word.startswith(current)})


def _possible(words: Sequence[str], current: str) -> Iterator[str]:
    from jerkbench import plugins
    from jerkbench.verbs import parser as whole

    parser = whole()
    place = 0
    while place < len(words) and words[place] in _verbs_of(parser):
        parser = _verbs_of(parser)[words[place]]
        place += 1
    if verbs := _verbs_of(parser):
        yield from verbs
    if current.startswith("-"):
        yield from (name for action in parser._actions for name in action.option_strings)  # noqa: SLF001 - no public name
    behind = words[place:]
    if words[:1] in (["show"], ["list"]):
        kinds = [*plugins.KINDS, "noise", "experiment"]
        yield from kinds if not behind else _names(behind[0]) if behind[0] in kinds else ()
    elif words[:1] == ["run"] or any(action.dest == "words" for action in parser._actions):  # noqa: SLF001
        yield from _settings(behind, current)
    elif words[:2] == ["data", "fetch"]:
        from jerkbench.fetching import public_recordings

        yield from public_recordings()
    elif any(action.dest == "source" for action in parser._actions) and not behind:  # noqa: SLF001
        yield from _names("dataset")


def _verbs_of(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    for action in parser._actions:  # noqa: SLF001 - no public name
        if isinstance(action, argparse._SubParsersAction):  # noqa: SLF001 - as above
            return dict(action.choices)
    return {}


def _names(kind: str) -> list[str]:
    from jerkbench import plugins

    return [*(plugins.names(kind) if kind in plugins.KINDS else ()), *preset_names(kind)]


def _settings(words: Sequence[str], current: str) -> Iterator[str]:
    """GROUP=NAME, also behind a comma; GROUP.PARAMETER= of the plugins that were chosen."""
    group, equals, value = current.partition("=")
    if equals:
        before = value[: value.rfind(",") + 1] or value[: value.rfind("[") + 1]
        yield from (f"{group}={before}{name}" for name in (_names(group) if group in CHOSEN_GROUPS else ()))
        return
    yield from (f"{name}=" for name in (*CHOSEN_GROUPS, *_OTHERS))
    if "." in current:
        yield from _parameters(words, group.partition(".")[0])
    else:
        yield from (f"{group}." for group, _ in _chosen(words))


def _chosen(words: Sequence[str]) -> Iterator[tuple[str, str]]:
    from jerkbench.presets import default_names

    typed = [(group, value) for group, _, value in (word.partition("=") for word in words) if group in CHOSEN_GROUPS]
    for group, value in {**default_names(), **dict(typed)}.items():
        yield from ((group, name) for name in value.strip("[]").split(",") if name)


def _parameters(words: Sequence[str], group: str) -> Iterator[str]:
    """GROUP.PARAMETER= of a group's plugins; of a disturbance GROUP.NAME.PARAMETER=."""
    from jerkbench import plugins
    from jerkbench.presets import preset

    for kind, name in _chosen(words):
        if kind == group and kind in plugins.KINDS:
            plugin = name if name in plugins.names(kind) else str(preset(kind, name)["name"])
            owner = f"{kind}.{name}" if kind == "disturbance" else kind
            yield from (f"{owner}.{field.name}=" for field in dataclasses.fields(plugins.get(kind, plugin)))
