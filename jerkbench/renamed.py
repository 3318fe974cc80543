"""Plugins and presets that were renamed. The old names still work for one more version."""

import re
from collections.abc import Mapping

RENAMED: Mapping[str, Mapping[str, str]] = {
    "dataset": {f"field_v1{end}": f"field_white{end}" for end in ("", "_ruts")},
    "disturbance": {"bias": "imu_bias"},
    "filter": {"baseline_naive": "baseline_untuned"},
    "noise": {"naive": "untuned", "own": "default"},
}
"""New names by kind and by old name."""


def new_name(kind: str, name: str) -> str:
    """Return the new name of a plugin or preset, or ``name`` if it was not renamed."""
    return RENAMED.get(kind, {}).get(name, name)


def new_label(kind: str, label: str) -> str:
    """Return the label of a stored row with old names replaced by new names. Parameters in the label do not change.

    >>> new_label("disturbance", "bias(accel_mps2=0.1)+gnss_outage")
    'imu_bias(accel_mps2=0.1)+gnss_outage'
    """
    if kind not in RENAMED:
        return label
    return re.sub(r"(\([^()]*\))|\w+", lambda match: match[1] or new_name(kind, match[0]), label)


def new_argument(argument: str) -> str:
    """Return a command-line argument with old names replaced by new names.

    >>> new_argument("disturbance=none,[bias,gnss_outage]"), new_argument("disturbance.bias.accel_mps2=0.1")
    ('disturbance=none,[imu_bias,gnss_outage]', 'disturbance.imu_bias.accel_mps2=0.1')
    """
    key, equals, value = argument.partition("=")
    group = key.lstrip("+~").partition("@")[0]
    if group in RENAMED:
        return f"{key}{equals}{new_label(group, value)}"
    kind, *rest = key.split(".")
    if kind in RENAMED and len(rest) > 1:
        return ".".join([kind, new_name(kind, rest[0]), *rest[1:]]) + equals + value
    return argument
