"""`medor view` hands its words to the viewer and its exit code back."""

import subprocess
import sys

MEDOR = [sys.executable, "-m", "medor_wire.cli"]


def test_the_viewers_own_help_and_complaints_come_through():
    shown = subprocess.run([*MEDOR, "view", "--help"], capture_output=True, text=True, check=True)
    assert "--interactive" in shown.stdout
    failed = subprocess.run([*MEDOR, "view", "nowhere.obj"], capture_output=True, text=True, check=False)
    assert failed.returncode == 1
    assert "medor view: nowhere.obj does not exist" in failed.stderr
