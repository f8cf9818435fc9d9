"""Laws of the study `peers`; its peers themselves are no part of the tests."""

import numpy as np
import pytest

from diagrams.batch.run import Run
from diagrams.identification import peers
from diagrams.identification.simulated import draw_truth


def test_the_truth_of_what_is_told_is_what_is_told():
    known = draw_truth(np.random.default_rng(3), "rotor_speed").known
    told = dict(zip(peers.NAMES, (0.9, 1.2, 0.8, 1.1, 1.3, 0.02, -0.01, 0.2), strict=True))
    dut = peers.truth_of(peers.vehicle_of(known, told), 0.2, known)
    assert dut == pytest.approx(told, rel=1e-12)


def test_without_a_peer_it_is_one_line(monkeypatch, tmp_path):
    monkeypatch.setattr(peers, "find_spec", lambda name: None)
    with pytest.raises(ValueError, match=r"pip install 'np_drake\[peers\]'"):
        peers.run(Run(seed=1, scratch=tmp_path))
