"""Claims in object stores hold as those in folders do, where the store can say who was first."""

import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

from jerkbench.places import place
from jerkbench.sweep import claims as module
from jerkbench.sweep import claims_in_stores
from jerkbench.sweep.claims import Claims, machine
from jerkbench.sweep.claims_in_stores import StoredClaims, Unclaimed, claims_in, says_who_was_first

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning")


@pytest.fixture
def folder(address):
    return place(f"{address}/study/.claims")


@pytest.mark.slow
def test_of_many_who_claim_at_once_one_gets_it(folder):
    claims = [claims_in(folder, "plan") for _ in range(8)]
    together = threading.Barrier(len(claims))

    def take(one):
        together.wait()
        return [one.take(bundle) for bundle in range(5)]

    with ThreadPoolExecutor(len(claims)) as pool:
        for one in claims:
            one.__enter__()
        taken = list(pool.map(take, claims))
    assert all(isinstance(one, StoredClaims) for one in claims)
    assert [sum(of) for of in zip(*taken, strict=True)] == [1] * 5

    for one in claims:
        one.__exit__(None, None, None)
    assert not list(folder.glob("*"))


def test_what_one_gives_up_or_leaves_is_anothers(folder):
    with claims_in(folder, "plan") as first:
        assert first.alone()
        with claims_in(folder, "plan") as second:
            assert [first.take(7), second.take(7), second.take(8), first.take(8)] == [True, False, True, False]
            assert not first.alone()
            first.release(7)
            assert second.take(7)
        assert not first.alone()
        assert [first.take(7), first.take(8)] == [True, True]


def test_two_that_leave_at_the_same_moment_leave_nothing(folder, monkeypatch):
    first, second = (claims_in(folder, "plan").__enter__() for _ in range(2))
    leave = first._leave

    def late():
        second.__exit__(None, None, None)
        leave()

    monkeypatch.setattr(first, "_leave", late)
    first.__exit__(None, None, None)
    assert not list(folder.glob("*"))


@pytest.mark.parametrize(("silent_s", "taken"), [(module.LIMIT_S - 30, False), (module.LIMIT_S + 30, True)])
def test_who_is_silent_for_long_has_lost_its_claims(folder, silent_s, taken, monkeypatch):
    with claims_in(folder, "plan") as first:
        for name in ("elsewhere_1.4711.0123456789ab.process", "plan.7.0.claim"):
            (folder / name).write_text("elsewhere_1.4711.0123456789ab")
        of = module._modified_s
        monkeypatch.setattr(module, "_modified_s", lambda path: of(path) - silent_s * ("elsewhere" in path.name))
        assert first.take(7) is taken


def test_where_nobody_can_say_who_was_first_it_is_said(folder, monkeypatch):
    """As in a store, or a package for one, that makes an object whether it is there or not."""
    said = []
    monkeypatch.setattr(claims_in_stores, "_made", lambda path, content: bool(path.write_text(content)))
    monkeypatch.setattr(claims_in_stores, "notify", said.append)

    assert not says_who_was_first(folder)
    assert isinstance(claims_in(folder, "plan"), Unclaimed)
    assert said == [f"{folder} cannot say which of two processes was first: let one process at a time work there"]
    assert not list(folder.glob("*"))


def test_a_folder_of_this_machine_has_files(tmp_path):
    with claims_in(tmp_path / "claims", "plan") as own:
        assert type(own) is Claims
        assert own.seen.name.startswith(machine())
