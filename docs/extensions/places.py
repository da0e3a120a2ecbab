"""Lines that stand for what is made from the sources.

*`make docs` fills this in (NAME WORDS), at `build/docs/PAGE.html`.* is what those see who read a
page as it is.
"""

import re

PLACE = re.compile(r"^\*`make docs` fills this in \((.+)\), at `(.+)`\.\*$", re.MULTILINE)
