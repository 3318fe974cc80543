"""The sentences below a study's tables: notes on its cells, their code, and remarks about what is left out."""

from collections.abc import Mapping, Sequence
from typing import Any

from jerkbench.plain import plain
from jerkbench.results.shown_cells import Current

Metadata = Mapping[str, Any]
"""What is known of a cell."""


def notes_of(keys: Sequence[str], cells: Sequence[Metadata], manifest: dict[str, Any]) -> list[str]:
    """Return the notes of the configuration, and then of the recordings, about the cells that are shown."""
    configured = [note for key in keys for note in manifest.get("notes", {}).get(key, [])]
    return list(dict.fromkeys([*configured, *(note for cell in cells for note in cell["notes"])]))


def code_of(cells: Sequence[Metadata]) -> str:
    """The commit, or how many there are; without one the beginning of the code's hash."""
    named = {cell["commit"] or f"code {cell['code'][:12]}" for cell in cells}
    return f"{len(named)} versions of the code" if len(named) > 1 else f"commit {named.pop()}"


def remarks_on(cells: Sequence[Metadata], chosen: Current, broken: list[str]) -> list[str]:
    """Return remarks about the cells that are shown, and about those that are left out."""
    remarks = []
    codes = {(cell["code"], tuple(sorted(cell["versions"].items()))) for cell in cells}
    if len(codes) > 1:
        remarks.append(f"These results come from {len(codes)} versions of the code or its libraries.")
    if len(kinds := {kind for cell in cells if (kind := cell.get("processor"))}) > 1:
        named = ", ".join(sorted({kind.partition(":")[0] for kind in kinds}))
        remarks.append(f"These results come from {len(kinds)} kinds of processors ({named}): last bits may differ.")
    if others := chosen.outdated - chosen.overlapping:
        which = "1 result of the same name" if others == 1 else f"{others} results of the same names"
        remarks.append(f"{which} with other settings, code or data {'is' if others == 1 else 'are'} left out.")
    if chosen.overlapping:
        which = "1 result is" if chosen.overlapping == 1 else f"{chosen.overlapping} results are"
        remarks.append(f"{which} left out: of the same name as another, with some of the same seeds.")
    if broken:
        remarks.append(f"{damaged(broken)} left out: {', '.join(map(plain, broken))}.")
    return remarks


def set_aside(names: list[str]) -> str:
    """Return a sentence about damaged files whose cells run again."""
    cells = "its cells" if len(names) == 1 else "their cells"
    return f"{damaged(names)} set aside, {cells} run again: {', '.join(map(plain, names))}."


def damaged(keys: list[str]) -> str:
    """Return the beginning of a sentence about files of cells that are damaged."""
    return "1 damaged file of cells is" if len(keys) == 1 else f"{len(keys)} damaged files of cells are"
