"""Numbers of ranks that tests of MPI take (test support).

Every change needs three: they have shares of unequal size, and one with a neighbour on each side.
"""

import pytest

TO_THREE = [
    pytest.param(1, marks=pytest.mark.nightly),
    pytest.param(2, marks=pytest.mark.nightly),
    3,
]
SEVERAL = TO_THREE[1:]
