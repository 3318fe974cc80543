"""The picture of a report in README and docs: ``python docs_build/report_picture.py REPORT.html PICTURE.png``."""

import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

WIDTH, HEIGHT = 1400, 1000
"""Of the browser's window, in pixels."""


def main() -> None:
    """Write what a browser shows of a report first, at three quarters of the size."""
    report, picture = (Path(name).resolve() for name in sys.argv[1:3])
    with tempfile.TemporaryDirectory() as folder:
        shot = Path(folder, "shot.png")
        window = ["--headless=new", "--no-sandbox", "--hide-scrollbars", f"--window-size={WIDTH},{HEIGHT}"]
        subprocess.run(["chromium", *window, f"--screenshot={shot}", report.as_uri()], check=True, capture_output=True)  # noqa: S603, S607
        with Image.open(shot) as image:
            small = image.convert("RGB").resize((WIDTH * 3 // 4, HEIGHT * 3 // 4), Image.Resampling.LANCZOS)
            small.quantize(64).save(picture, optimize=True)


if __name__ == "__main__":
    main()
