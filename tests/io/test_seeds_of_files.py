"""The file of each seed."""

import pytest

from jerkbench.errors import RecordingError
from jerkbench.io.trajectory import files_digest, pattern_of, seeds_of


@pytest.mark.parametrize(
    ("names", "pattern"),
    [
        (["run_0.tum", "run_1.tum"], "run_{seed}.tum"),
        (["out/10/a2.csv", "out/9/a2.csv", "out/8/a2.csv"], "out/{seed}/a2.csv"),
        (["alone_3.tum"], "alone_3.tum"),
        (["run_{seed}.tum"], "run_{seed}.tum"),
    ],
)
def test_the_number_that_tells_files_apart_is_the_seed(names, pattern):
    assert pattern_of(names) == pattern


@pytest.mark.parametrize(
    "names", [["a.tum", "b.tum"], ["a0_0.tum", "a1_1.tum"], ["a_00.tum", "a_01.tum"], ["a_1.tum", "b_2.tum"]]
)
def test_files_that_no_one_number_tells_apart_are_refused(names):
    with pytest.raises(RecordingError, match="must differ in one number, the seed"):
        pattern_of(names)


def test_seeds_are_in_the_order_of_their_numbers(tmp_path):
    for seed in (10, 9, 2):
        (tmp_path / f"[x]_{seed}.tum").write_text("")
    (tmp_path / "[x]_old.tum").write_text("")

    assert list(seeds_of(str(tmp_path / "[x]_{seed}.tum"))) == [2, 9, 10]


def test_the_digest_tells_contents_and_seeds_apart(tmp_path):
    pattern = str(tmp_path / "{seed}.tum")
    digests = set()
    for contents in ({0: "a"}, {0: "b"}, {0: "a", 1: "b"}, {0: "b", 1: "a"}):
        for seed, content in contents.items():
            (tmp_path / f"{seed}.tum").write_text(content)
        digests.add(files_digest(pattern))

    assert len(digests) == 4
    with pytest.raises(RecordingError, match="There is no trajectory"):
        files_digest(str(tmp_path / "x{seed}.tum"))
