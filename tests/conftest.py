"""Fixtures of all tests."""

import uuid
from pathlib import Path
from types import SimpleNamespace

import pytest

from jerkbench.cli import main

SHARED = Path(__file__).parents[2] / "shared"


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
