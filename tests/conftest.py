"""What all tests share."""

from pathlib import Path

import pytest

SHARED = Path(__file__).parents[2] / "shared"


@pytest.fixture(scope="session")
def shared_folder():
    """The folder with the reference values and the real recordings, which is not part of the product."""
    if not SHARED.is_dir():
        pytest.skip("the folder ../shared with reference values and recordings is not there")
    return SHARED
