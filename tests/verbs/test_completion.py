"""The words that a shell offers, asked of Python and of a real bash."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from commands import verb
from jerkbench.errors import PluginError
from jerkbench.verbs.completing import completions


@pytest.mark.parametrize(
    ("line", "some"),
    [
        ("jerkbench ", {"run", "tune", "smooth", "data", "completion"}),
        ("jerkbench data fe", {"fetch"}),
        ("jerkbench data fetch ta", {"taroz"}),
        ("jerkbench suite run adaptation=mtf_", {"adaptation=mtf_block", "adaptation=mtf_nis"}),
        ("jerkbench run filter=const", {"filter=constant_turn", "filter=constant_velocity"}),
        ("jerkbench run -m filter=jerk,base", {"filter=jerk,baseline", "filter=jerk,baseline_untuned"}),
        ("jerkbench run disturbance=[imu_bias,gnss_o", {"disturbance=[imu_bias,gnss_outage"}),
        ("jerkbench run experiment=pap", {"experiment=paper"}),
        ("jerkbench run filter=jerk filter.j", {"filter.jerk_mps3_per_sqrt_s="}),
        ("jerkbench run filter.accel", {"filter.accel_mps2="}),
        ("jerkbench run disturbance=gnss_outage disturbance.gnss_outage.w", {"disturbance.gnss_outage.windows_s="}),
        ("jerkbench run dataset=taroz dataset.position_sh", {"dataset.position_shift_s="}),
        ("jerkbench show filter okf", {"okf"}),
        ("jerkbench tune --mul", {"--multirun"}),
        ("jerkbench data inspect taro", {"taroz"}),
        ("jerkbench table results/f", set()),
        ("jerkbench run nosuch=", set()),
        ("jerkbench", {"run"}),
    ],
)
def test_what_may_stand_there_is_offered(line, some):
    offered = set(completions(line))

    assert some <= offered
    if line.count(" ") > 1:
        assert offered == some


def test_presets_of_ones_own_are_offered(tmp_path):
    (tmp_path / "dataset").mkdir()
    (tmp_path / "dataset" / "my_drive.yaml").write_text("defaults: [field, _self_]\n")

    assert completions(f"jerkbench run --config-dir {tmp_path} dataset=my") == ["dataset=my_drive"]
    assert completions("jerkbench run dataset=my") == []
    with pytest.raises(PluginError, match="no folder"):
        completions("jerkbench run --config-dir nowhere dataset=my")


@pytest.mark.skipif(not shutil.which("bash"), reason="there is no bash")
@pytest.mark.parametrize(
    ("line", "reply"),
    [
        ("jerkbench data fe", "fetch"),
        ("jerkbench run filter=jer", "jerk"),  # readline begins behind =
        ("jerkbench run -m filter=bias,jer", "bias,jerk"),
        ("jerkbench run filter=jerk filter.jer", "filter.jerk_mps3_per_sqrt_s="),
    ],
)
def test_bash_completes(line, reply, tmp_path):
    script = verb("completion", "bash", cwd=tmp_path).stdout
    asked = f"{script}\nCOMP_LINE='{line}'; COMP_POINT={len(line)}; _jerkbench; printf '%s\\n' \"${{COMPREPLY[@]}}\""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    done = subprocess.run(
        ["bash", "-c", asked], env={**os.environ, "PATH": path}, capture_output=True, text=True, check=True
    )

    assert done.stdout.split() == [reply], done.stderr


@pytest.mark.parametrize("shell", ["bash", "fish", "zsh"])
def test_the_script_of_each_shell_says_where_it_goes(shell, tmp_path):
    done = verb("completion", shell, cwd=tmp_path)

    assert f"jerkbench completion {shell}" in done.stdout.splitlines()[0]
    assert f"jerkbench completion {'bash' if shell == 'zsh' else shell} --line" in done.stdout
