"""Fixture: the packaged models made anew."""

import pytest

from diagrams.tracking.packaged import make_packaged_models


@pytest.fixture(scope="session")
def remade(tmp_path_factory):
    """Files of `default` and `pendulum`, as `np-drake reproduce models` makes them."""
    return make_packaged_models(tmp_path_factory.mktemp("packaged"))
