from commands import jerkbench


def test_a_simulated_recording_is_described(tmp_path):
    done = jerkbench("data", "inspect", "field", "--set", "duration_s=20", cwd=tmp_path)

    assert done.returncode == 0, done.stderr
    assert "imu          2000 rows, 100 Hz, 0.010 to 20.000 s; no gaps" in done.stdout
    assert "position      100 rows, 5 Hz" in done.stdout
    assert "gravity is felt on +z" in done.stdout


def test_what_is_no_source_is_a_sentence(tmp_path):
    done = jerkbench("data", "inspect", "gone.bag", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (2, "jerkbench: There is no file or folder gone.bag; correct the path.\n")
    done = jerkbench("data", "inspect", "feild", cwd=tmp_path)
    assert "Did you mean 'field'?" in done.stderr
    (tmp_path / "a.xyz").touch()
    done = jerkbench("data", "inspect", "a.xyz", cwd=tmp_path)
    assert "give --dataset NAME" in done.stderr
