"""Parameters of commands, files and calls, each declared once as a field of a dataclass.

The annotation of a field says which values it takes, and `option` what it means. From these follow
command lines (`command_line`), the reading of files (`documents`), the sentences about mistakes
(`sentences`) and the tables of the documentation (`fields`).
"""

from carillon.parameters.model import (
    REQUIRED,
    Check,
    OneOf,
    Within,
    checked,
    option,
    parameters,
)

__all__ = ["REQUIRED", "Check", "OneOf", "Within", "checked", "option", "parameters"]
