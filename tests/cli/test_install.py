"""Other distributions that use the plain names of this one's packages."""

import os
import subprocess
import sys
from pathlib import Path

from torsight.cli.checkup.install import check_install

ROOT = Path(__file__).parents[2]


def test_another_distribution_with_a_package_of_ours_is_named() -> None:
    (finding,) = check_install({"sync": ["torsight", "sync-tools"], "tracker": ["torsight"], "numpy": ["numpy"]})
    assert finding.level == "limits"
    assert "'sync' is also installed by the distribution sync-tools" in finding.text
    assert "pip uninstall sync-tools" in finding.do


def test_an_environment_of_its_own_is_fine() -> None:
    assert check_install({name: ["torsight"] for name in ("torsight", "tracker", "calibration", "sync")}) == []


def test_what_is_installed_is_asked_for() -> None:
    assert check_install() == []


def test_a_package_of_ours_that_was_written_over_is_told_by_the_doctor(tmp_path: Path) -> None:
    (tmp_path / "sync").mkdir()
    (tmp_path / "sync" / "__init__.py").write_text("")
    (tmp_path / "sync_tools-0.1.dist-info").mkdir()
    for name, text in (
        ("METADATA", "Metadata-Version: 2.1\nName: sync-tools\nVersion: 0.1\n"),
        ("RECORD", "sync/__init__.py,,\n"),
    ):
        (tmp_path / "sync_tools-0.1.dist-info" / name).write_text(text)
    (tmp_path / "temps.csv").write_text("time_s,temp_a_c,temp_b_c\n0,24,24\n1,24,24\n")
    done = subprocess.run(
        [sys.executable, "-m", "torsight.cli.main", "doctor", "temps.csv"],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 3
    assert "installation: the package 'sync' is also installed by the distribution sync-tools" in done.stderr
    assert "internal error" not in done.stderr
