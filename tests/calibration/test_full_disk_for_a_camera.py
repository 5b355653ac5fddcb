"""``calibrate`` on a disk that is full: the camera file that was there stays, at either of its two files."""

import pytest

from tests.command_line import leave
from tests.full_disk import full_disk


@pytest.mark.parametrize(("limit_bytes", "refused"), [(100, "camera.toml"), (10_000, "camera.coverage.png")])
def test_an_older_camera_file_stays(limit_bytes, refused, folder, board_toml, tmp_path, capsys):
    out = tmp_path / "camera.toml"
    for path in (out, out.with_suffix(".coverage.png")):
        path.write_text("older")
    with full_disk(limit_bytes):
        code = leave("calibrate", folder, "--board", board_toml, "--out", out)
    told = capsys.readouterr().err
    assert code == 3, told
    assert f"{tmp_path / refused}: cannot be written (File too large)" in told
    assert (tmp_path / refused).read_text() == "older"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["camera.coverage.png", "camera.toml"]
