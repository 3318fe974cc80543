"""The bar of a sweep: what is left, and nothing where nothing is."""

from jerkbench.report.progress import Progress


def test_what_is_left_is_counted(capsys):
    with Progress(4, already=1) as progress:
        for _ in range(3):
            progress.advance(["ok", "diverged"])
    err = capsys.readouterr().err
    assert "1 of 4 cells are done already." in err
    assert "3/3 cells" in err
    assert "3 runs diverged" in err


def test_without_anything_left_there_is_no_bar(capsys):
    with Progress(3, already=3):
        pass
    assert capsys.readouterr().err == "3 of 3 cells are done already.\n"
