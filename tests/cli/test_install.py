"""Other distributions that use the plain names of this one's packages."""

from torsight.cli.checkup.install import check_install


def test_another_distribution_with_a_package_of_ours_is_named() -> None:
    (finding,) = check_install({"sync": ["torsight", "sync-tools"], "tracker": ["torsight"], "numpy": ["numpy"]})
    assert finding.level == "limits"
    assert "'sync' is also installed by sync-tools" in finding.text
    assert "pip uninstall sync-tools" in finding.do


def test_an_environment_of_its_own_is_fine() -> None:
    assert check_install({name: ["torsight"] for name in ("torsight", "tracker", "calibration", "sync")}) == []


def test_what_is_installed_is_asked_for() -> None:
    assert check_install() == []
