"""Fixtures of all tests."""

import uuid
from pathlib import Path
from types import SimpleNamespace

import pytest

from jerkbench.cli import main

SHARED = Path(__file__).parents[2] / "shared"

TOGETHER = (
    *("audit/test_small_audit.py", "audit/test_whole_audit.py", "authoring/test_mistakes_of_an_author.py"),
    *("authoring/test_new_packages.py", "examples", "external/test_score.py", "report/page"),
    *("results/test_bibliography.py", "results/test_store_under_fire.py", "suite/test_suite_entries.py"),
    *("test_agents.py", "test_any_language.py", "test_command_line.py", "test_documentation.py"),
    *("test_hostile_results.py", "test_own_log.py", "test_pages.py", "test_site.py", "test_suite_page.py"),
    *("test_third_party.py", "test_verbs.py", "tuning/test_tune_verb.py"),
)
"""Tests that share a study, an installation or a browser: one process runs all of a place, and makes it once."""


def pytest_collection_modifyitems(items):
    """Keep together what shares (`--dist loadgroup`)."""
    for item in items:
        place = item.path.relative_to(Path(__file__).parent).as_posix()
        for group in TOGETHER:
            if place.startswith(group):
                item.add_marker(pytest.mark.xdist_group(group))


@pytest.fixture(scope="session")
def shared_folder():
    """The folder with the reference values and the real recordings, which is not part of the product."""
    if not SHARED.is_dir():
        pytest.skip("the folder ../shared with reference values and recordings is not there")
    return SHARED


@pytest.fixture
def typed(tmp_path, monkeypatch, capsys):
    """Types a command in an empty folder, in this process: the output and the exit code."""
    monkeypatch.chdir(tmp_path)

    def run(*words):
        code = 0
        try:
            main(words)
        except SystemExit as end:
            code = end.code
        printed = capsys.readouterr()
        return SimpleNamespace(returncode=code, stdout=printed.out, stderr=printed.err)

    return run


@pytest.fixture(params=["memory", "s3"])
def address(request, monkeypatch):
    """A folder that nobody has used: in memory, or in a server that talks as S3 does."""
    pytest.importorskip("upath")
    name = f"laboratory-{uuid.uuid4()}"  # what is in memory outlasts a test, and so do the buckets of the server
    if request.param == "memory":
        yield f"memory://{name}"
        return
    server = pytest.importorskip("moto.server", reason="moto[server] brings a server that talks as S3 does")
    boto3 = pytest.importorskip("boto3")
    pytest.importorskip("s3fs").S3FileSystem.clear_instance_cache()  # of a server that has ended
    for key in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.setenv(key, "testing")
    running = server.ThreadedMotoServer(port=0, verbose=False)
    running.start()
    host, port = running.get_host_and_port()
    monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://{host}:{port}")
    boto3.client("s3", region_name="us-east-1").create_bucket(Bucket=name)
    yield f"s3://{name}/results"
    running.stop()
