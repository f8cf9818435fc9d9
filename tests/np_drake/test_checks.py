"""Laws of the check of what a user gives."""

import pytest

from np_drake.checks import require
from np_drake.logs.errors import LogError


@pytest.mark.parametrize("error", [ValueError, LogError])
def test_what_does_not_hold_is_one_line_of_the_error_that_is_named(error):
    require([0.0], "track: must hold points; got none.", error)
    with pytest.raises(error, match="must hold points; got none") as caught:
        require([], "track: must hold points; got none.", error)
    assert type(caught.value) is error
