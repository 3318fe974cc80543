"""Presets that are not valid YAML are refused in a sentence."""

import pytest

from commands import verb


@pytest.mark.parametrize("text", ["a: [1\nb: }", "study: a\nstudy: b", "study: !!python/object/apply:os.system [ls]"])
def test_what_is_no_yaml_is_a_sentence(tmp_path, text):
    preset = tmp_path / "presets" / "experiment" / "mine.yaml"
    preset.parent.mkdir(parents=True)
    preset.write_text(f"# @package _global_\n{text}")
    done = verb("run", "--config-dir", tmp_path / "presets", "experiment=mine", cwd=tmp_path)
    assert done.returncode == 2
    assert "mine.yaml cannot be read" in done.stderr
