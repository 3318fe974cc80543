"""Fetching from a server on this machine that can be told to misbehave."""

import hashlib
import json
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
import pytest

import pages
from commands import verb
from jerkbench.cli.recordings import dataset_of
from jerkbench.errors import RecordingError
from jerkbench.io import fetching
from jerkbench.io.fetching import PublicFile, PublicRecording, fetch, public_recording, public_recordings

CONTENT = bytes(range(256)) * 2000
SHA256 = hashlib.sha256(CONTENT).hexdigest()


class Misbehaving(BaseHTTPRequestHandler):
    """Serves CONTENT at /whole, and cuts the first answers at /cut; the requests are written down."""

    cuts = 0
    asked: list[str]

    def do_GET(self):
        cls = type(self)
        cls.asked.append(self.path)
        if self.path in ("/gone", "/busy"):
            self.send_error(404 if self.path == "/gone" else 503)
            return
        if self.path.startswith("/redirect:"):
            self.send_response(302)
            self.send_header("Location", self.path.removeprefix("/redirect:"))
            self.end_headers()
            return
        self.send_response(200)
        self.send_header("Content-Length", str(len(CONTENT)))
        self.end_headers()
        cut = self.path == "/cut" and cls.cuts > 0
        cls.cuts -= cut
        self.wfile.write(CONTENT[:100_000] if cut else CONTENT)

    def log_message(self, *_):
        pass


@pytest.fixture
def server():
    handler = type("Handler", (Misbehaving,), {"asked": []})
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as running:
        thread = threading.Thread(target=running.serve_forever, daemon=True)
        thread.start()
        handler.address = f"http://127.0.0.1:{running.server_port}"
        yield handler
        running.shutdown()
        thread.join()


def recording(server, path, sha256=SHA256, name="deep/a.bin", size=0):
    return PublicRecording("some", "a test", "MIT", (PublicFile(name, f"{server.address}{path}", sha256, size),))


def test_what_is_whole_is_kept_and_not_asked_for_again_unless_it_was_damaged(server, tmp_path):
    lines = []
    for _ in range(2):
        fetch(recording(server, "/whole", size=len(CONTENT)), tmp_path / "some", lines.append)

    assert (tmp_path / "some" / "deep" / "a.bin").read_bytes() == CONTENT
    assert [path.name for path in tmp_path.iterdir()] == ["some"]
    assert sorted(path.name for path in (tmp_path / "some").rglob("*")) == ["a.bin", "deep"]
    assert lines == ["deep/a.bin: downloading 0.5 MB", "deep/a.bin: there"]
    assert server.asked == ["/whole"]
    (tmp_path / "some" / "deep" / "a.bin").write_bytes(b"damaged")
    fetch(recording(server, "/whole"), tmp_path / "some", print)
    assert (tmp_path / "some" / "deep" / "a.bin").read_bytes() == CONTENT


def test_a_cut_connection_is_tried_again_and_whole_files_stay_if_it_is_always_cut(server, tmp_path, monkeypatch):
    monkeypatch.setattr("time.sleep", lambda _: None)  # pooch waits for some seconds before it tries again
    server.cuts = 2
    fetch(recording(server, "/cut"), tmp_path / "some", print)
    assert (tmp_path / "some" / "deep" / "a.bin").read_bytes() == CONTENT
    server.cuts = fetching.RETRIES + 1
    whole, cut = recording(server, "/whole", name="b.bin").files, recording(server, "/cut", name="c.bin").files
    both = PublicRecording("both", "a test", "MIT", (*whole, *cut))
    with pytest.raises(
        RecordingError, match=r"/cut cannot be downloaded \(ChunkedEncodingError\); run the command again"
    ):
        fetch(both, tmp_path / "both", print)
    assert not (tmp_path / "both").exists()
    fetch(both, tmp_path / "both", print)
    assert server.asked.count("/whole") == 1
    assert sorted(path.name for path in (tmp_path / "both").iterdir()) == ["b.bin", "c.bin"]


def test_another_file_is_refused_and_not_kept(server, tmp_path):
    with pytest.raises(RecordingError, match="differs from the registry"):
        fetch(recording(server, "/whole", sha256="0" * 64), tmp_path / "some", print)
    assert not (tmp_path / "some").exists()
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("/gone", "answers 404"),
        ("/busy", "answers 503"),
        ("/redirect:file:///etc/passwd", r"cannot be downloaded \(InvalidSchema\)"),
    ],
)
def test_a_refusal_is_a_sentence(server, tmp_path, path, message, monkeypatch):
    monkeypatch.setattr("time.sleep", lambda _: None)
    with pytest.raises(RecordingError, match=message):
        fetch(recording(server, path), tmp_path / "some", print)
    assert not (tmp_path / "some").exists()


def test_a_server_that_is_not_there_and_a_folder_that_cannot_be_written_are_sentences(server, tmp_path):
    one = PublicRecording("some", "a test", "MIT", (PublicFile("a", "http://127.0.0.1:9/a", "0" * 64),))
    with pytest.raises(RecordingError, match="cannot be downloaded"):
        fetch(one, tmp_path / "some", print)
    (tmp_path / "file").touch()
    with pytest.raises(RecordingError, match="cannot be written"):
        fetch(recording(server, "/whole"), tmp_path / "file" / "some", print)


def test_the_registry_lists_whole_recordings_at_fixed_commits():
    known = public_recordings()
    drives = {"rtklib_drive_0708", "comma2k19", "broad", "robot_localization"}
    assert set(known) == drives | {"tokyo_1105", "pixel4", "taroz", "ppc", "uwb_outdoor"}
    for one in known.values():
        for file in one.files:
            assert len(file.sha256) == 64
            assert file.url.startswith("https://raw.githubusercontent.com/")
            assert " " not in file.url
            assert "|" not in file.url
    with pytest.raises(RecordingError, match="Did you mean 'broad'"):
        public_recording("brod")


CONVERTED = {"taroz", "ppc", "uwb_outdoor"}
"""Of these no published file is beside, only tables that were made of it."""


def test_the_registry_has_the_hashes_and_sources_of_the_files_beside(shared_folder):
    for one in public_recordings().values():
        for file in one.files if one.name not in CONVERTED else ():
            folder = shared_folder / "data" / one.name
            path = (folder if folder.is_dir() else folder.parent / "degraded" / one.name) / file.name
            assert hashlib.sha256(path.read_bytes()).hexdigest() == file.sha256, path
            assert file.size == path.stat().st_size, path
    known = public_recordings()
    for meta in sorted((shared_folder / "data" / "journeys").glob("*/*/meta.json")):
        about = json.loads(meta.read_text())
        if about["group"] in CONVERTED:
            urls = {file.url for file in known[about["group"]].files}
            base = f"https://raw.githubusercontent.com/{about['repository']}/{about['commit']}/"
            assert {base + path for path in about["paths"][:2]} <= urls, meta
            assert known[about["group"]].licence == about["licence"]


FIXES_OF = {
    "taroz": {
        "rover_1Hz_spp.pos": "% GPST latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m) sdne(m) sdeu(m)"
        " sdun(m) age(s) ratio vn(m/s) ve(m/s) vu(m/s) sdvn sdve sdvu sdvne sdveu sdvun\n"
        + "".join(
            f"2024/07/20 09:52:{30 + k}.000 35.16531{k} 136.88146 40.2 5 30 2.4 2.0 5.7 1.1 -1.5 -1.9 0 0"
            " 0.1 0.2 0.0 0.07 0.06 0.18 0.03 -0.06 -0.02\n"
            for k in range(5)
        ),
        "reference.csv": "GPS TOW (s),GPS Week,Latitude (deg),Longitude (deg),Ellipsoid Height (m),ECEF X (m),"
        "East Velocity (m/s),North Velocity (m/s),Up Velocity (m/s)\n"
        + "".join(f"{553950 + k}.0, 2323, 35.16531{k}, 136.88146, 41.2, 0, 0.2, 0.1, 0.0\n" for k in range(5)),
    },
    "ppc_fixes": {
        "nagoya_run1/fixes.txt": "% columns\n"
        + "".join(f"2325 {550380 + k}.0 -3810244.{k} 3567870.9 3652891.8 35.1 136.8 45.6 1 26 1.1\n" for k in range(5)),
        "nagoya_run1/reference.txt": "% columns\n"
        + "".join(
            f"2325 {550380 + k}.0 -3810242.{k} 3567866.6 3652891.1 35.1 136.8 41.4 {4 if k != 2 else 3} 23 2 0 9384\n"
            for k in range(5)
        ),
    },
    "uwb_outdoor": {
        "los_case_1/LS.csv": "timestamp,x,y,z\n"
        + "".join(f"17345014855{k}4849980,-2.{k},-4.2,1.08\n" for k in range(5)),
        "los_case_1/trajectory.csv": "timestamp,x,y,z,heading_degrees\n"
        + "".join(f"1.73450148{5 + k}5003267e+18,-2.{k},-4.25,0.0,0.0\n" for k in range(5)),
    },
}
"""Some rows of each, made up, as the publishers write them."""


@pytest.mark.parametrize(("preset", "truths"), [("taroz", 5), ("ppc_fixes", 4), ("uwb_outdoor", 5)])
def test_the_presets_read_what_is_fetched(preset, truths, tmp_path, monkeypatch):
    folder = tmp_path / ("ppc" if preset == "ppc_fixes" else preset)
    for name, text in FIXES_OF[preset].items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    monkeypatch.setenv("JERKBENCH_DATA", str(tmp_path))
    recording = dataset_of(preset, None, []).load(0)

    assert (len(recording.position.t_s), len(recording.reference.t_s)) == (5, truths)
    assert recording.reference.independent == (preset != "ppc_fixes")
    error_m = np.linalg.norm(recording.position.enu_m[0] - recording.reference.enu_m[0])
    assert error_m == pytest.approx({"taroz": 1.0, "ppc_fixes": 4.79, "uwb_outdoor": 1.08}[preset], abs=0.05)


def test_the_verb_lists_and_finds_and_says_how_to_fetch(tmp_path, monkeypatch):
    monkeypatch.setenv("JERKBENCH_DATA", str(tmp_path))
    done = verb("data", "fetch", cwd=tmp_path)
    assert "broad: a hand-held IMU with motion capture" in done.stdout
    assert "not fetched" in done.stdout
    shown = [line for line in pages.text("inspect").splitlines() if line.endswith("not fetched")]
    assert len(shown) == 3
    assert set(shown) <= set(done.stdout.splitlines())
    done = verb("data", "fetch", "brod", cwd=tmp_path)
    assert (done.returncode, "Did you mean 'broad'" in done.stderr) == (2, True)
    monkeypatch.setenv("JERKBENCH_DATA", str(tmp_path))
    done = verb("data", "inspect", "pixel4", cwd=tmp_path)
    assert (done.returncode, "run `jerkbench data fetch pixel4`" in done.stderr) == (2, True)


@pytest.mark.parametrize(
    ("name", "folder", "rows"), [("tokyo_1105", "degraded/tokyo_1105", 8851), ("comma2k19", "comma2k19", 579)]
)
def test_a_data_set_and_a_preset_find_what_was_fetched(tmp_path, shared_folder, monkeypatch, name, folder, rows):
    (tmp_path / name).symlink_to(shared_folder / "data" / folder)
    monkeypatch.setenv("JERKBENCH_DATA", str(tmp_path))
    done = verb("data", "inspect", name, cwd=tmp_path)
    assert f"position {rows:>8} rows" in done.stdout, done.stderr
