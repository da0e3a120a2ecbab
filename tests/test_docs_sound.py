"""Every command of the tutorial on sound runs as it stands there."""

import pytest

from tests.documentation import SOUND, Reader


@pytest.mark.nightly
def test_commands_of_sound_run_in_the_order_of_the_page(tmp_path):
    assert len(Reader(tmp_path).follow(SOUND)) > 5
    assert {"hit.wav", "elsewhere.wav", "pan.glb"} <= {path.name for path in tmp_path.iterdir()}
