"""rows.csv has the bytes that pandas would write."""

import numpy as np
import pandas as pd

from jerkbench.report.writers import write_rows_csv


def test_every_kind_of_column_is_written_as_pandas_does(tmp_path):
    rng = np.random.default_rng(5)
    numbers = np.r_[rng.standard_normal(20) * 10.0 ** rng.integers(-300, 300, 20), np.nan, np.inf, -np.inf, -0.0, 1e22]
    texts = ["plain", 'with "quotes"', "a, b", "two\nlines", "a\rb", "", "é", None, " blanks "]
    rows = pd.DataFrame(
        {
            "numbers": numbers,
            "text": pd.Series([texts[k % len(texts)] for k in range(25)], dtype="str"),
            "anything": [None if k % 3 else k / 7 for k in range(25)],
            "strange, name": np.arange(25) * 10**12,
            "flag": numbers > 0,
            "empty": np.nan,
        }
    )
    write_rows_csv(rows, tmp_path / "rows.csv")

    rows["text"] = rows["text"].str.replace("\r", r"\r")  # what ends a line for some and not for others is written out
    assert (tmp_path / "rows.csv").read_bytes() == rows.to_csv(index=False, lineterminator="\n").encode()


def test_no_rows_are_a_header(tmp_path):
    write_rows_csv(pd.DataFrame({"a": [1.0], "b": ["x"]}).iloc[:0], tmp_path / "rows.csv")

    assert (tmp_path / "rows.csv").read_text(encoding="utf-8") == "a,b\n"
