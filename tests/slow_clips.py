"""A process that finds modes of clips as slowly as a test likes (test support)."""

import time
from pathlib import Path
from typing import Any

from studio.processes.clips import ClipFile

SLOW = "tests.slow_clips:SlowClips"


class SlowClips:
    """Tells that it has begun, and ends once there is a file beside the clip."""

    def listen(self, tell: Any, clip: ClipFile) -> dict[str, Any]:
        """Modes of a clip, of which there are none."""
        tell(("bands of 98 Hz", 0.4))
        while not Path(f"{clip.path}.go").exists():
            time.sleep(0.01)
        return {"modes": [], "says": []}
