"""Results of checks as JUnit XML, which machines that build software read."""

from collections.abc import Sequence
from typing import NamedTuple
from xml.etree import ElementTree as ET


class JunitCase(NamedTuple):
    """One thing that was checked.

    Attributes:
        group: what it belongs to.
        name: of it.
        failures: sentences; none: it went well.
        remarks: sentences that are no failure.
    """

    group: str
    name: str
    failures: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()


def junit(suite: str, cases: Sequence[JunitCase]) -> str:
    """Return the text of a JUnit file with one suite."""
    failed = sum(bool(case.failures) for case in cases)
    root = ET.Element("testsuite", name=suite, tests=str(len(cases)), failures=str(failed), errors="0")
    for case in cases:
        element = ET.SubElement(root, "testcase", classname=case.group, name=case.name)
        for sentence in case.failures:
            ET.SubElement(element, "failure", message=sentence).text = sentence
        if case.remarks:
            ET.SubElement(element, "system-out").text = "\n".join(case.remarks)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode", xml_declaration=True) + "\n"
