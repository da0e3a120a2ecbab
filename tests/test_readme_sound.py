"""Every command of the README's section on sound runs as it stands there."""

from __future__ import annotations

import pytest

from tests.readme_commands import SOUND, run_commands, section


@pytest.mark.slow
def test_commands_of_sound_run_in_the_order_of_the_page(tmp_path):
    assert run_commands(section(SOUND), tmp_path) > 5
    assert {"hit.wav", "elsewhere.wav", "pan.glb"} <= {path.name for path in tmp_path.iterdir()}
