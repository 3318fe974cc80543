"""All of the study: its rows, the tables of the page, and the pictures.

    python experiments/attitude/page.py [FOLDER [OUT [SETTINGS [DRIVES]]]]

Without FOLDER it prints the tables of the kept rows. FOLDER holds broad, repoimu and kitti: then all of it is run, and
rows, pictures and tables (into README.md) are written to OUT, which is the folder of this file where none is named.
Fewer SETTINGS than 64 or DRIVES than all show that it runs, and give no tables.
"""

import os
import sys
from pathlib import Path

import pandas as pd
from figure import draw_dots, draw_over_time
from navigation import navigation_rows, navigation_table
from starts import start_rows, start_table
from tables import TABLES, Errors, errors_of
from trials import SETTINGS, all_rows, all_trials, saturated_rows

from jerkbench import files

HERE = Path(__file__).parent
ERRORS, NAVIGATION, STARTS, SATURATED = "errors.parquet", "navigation.parquet", "starts.parquet", "saturated.csv"


def stored_errors(folder: Path = HERE) -> Errors:
    """Return the errors in ``folder``."""
    return errors_of(pd.read_parquet(folder / ERRORS), pd.read_csv(folder / SATURATED))


def filled(page: str, errors: Errors, folder: Path = HERE) -> str:
    """Return the page with each of its tables from the rows in ``folder``."""
    tables = {name: make(errors) for name, make in TABLES.items()}
    tables["starts"] = start_table(pd.read_parquet(folder / STARTS))
    tables["navigation"] = navigation_table(pd.read_parquet(folder / NAVIGATION))
    return files.filled(page, tables)


def run(folder: Path, out: Path, settings: int, drives: int | None) -> None:
    """Compute all rows, and draw; what is in ``out``/rows already is taken."""
    workers = os.cpu_count() or 1
    out.mkdir(parents=True, exist_ok=True)
    trials = list(all_trials(folder))
    rows = all_rows(trials, out / "rows", workers, settings)
    complete = settings == SETTINGS
    rows.to_parquet(out / ERRORS, index=False)
    saturated_rows(trials).to_csv(out / SATURATED, index=False)
    errors = stored_errors(out if complete else HERE)
    start_rows(folder / "kitti").to_parquet(out / STARTS, index=False)
    navigation_rows(folder / "kitti", errors, drives, workers).to_parquet(out / NAVIGATION, index=False)
    draw_dots(errors, out / "inclination.png")
    draw_over_time(folder, out / "over_time.png")
    if complete and drives is None:
        page = filled((HERE / "README.md").read_text(encoding="utf-8"), errors, out)
        (out / "README.md").write_text(page, encoding="utf-8")
    print(f"{len(rows)} rows of {rows['trial'].nunique()} trials in {out / ERRORS}.")
    print(f"Starts and navigation: {out / STARTS}, {out / NAVIGATION}. Pictures: {out / 'inclination.png'}.")


def main() -> None:
    """Run all of it, or print the tables of what is kept."""
    if len(sys.argv) == 1:
        page = (HERE / "README.md").read_text(encoding="utf-8")
        print(filled(page, stored_errors()))
        return
    folder, *more = sys.argv[1:]
    out, settings, drives = (*more, *(str(HERE), SETTINGS, None)[len(more) :])
    run(Path(folder), Path(out), int(settings), None if drives is None else int(drives))


if __name__ == "__main__":
    main()
