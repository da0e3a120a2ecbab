"""One rank of a run: `carillon ARGUMENTS`, whose processor time and memory go into a file.

`python -m studies.crossover.rank FOLDER ARGUMENTS` adds a file to FOLDER. What starts ranks on
other machines does not know what they use there, so each tells it by itself.
"""

import json
import os
import resource
import socket
import sys
from pathlib import Path

from carillon.__main__ import main as carillon

FILES = "rank-*.json"


def main() -> int:
    """Run the command; returns its exit status."""
    folder, *words = sys.argv[1:]
    status = carillon(words)
    used = resource.getrusage(resource.RUSAGE_SELF)
    content = {
        "processor_seconds": used.ru_utime + used.ru_stime,
        "peak_memory_bytes": 1024 * used.ru_maxrss,
    }
    name = FILES.replace("*", f"{socket.gethostname()}-{os.getpid()}")
    Path(folder, name).write_text(json.dumps(content))
    return status


if __name__ == "__main__":
    sys.exit(main())
