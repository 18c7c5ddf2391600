"""Saved states: a run goes on from one as if nothing had happened, in any process."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from sblcosim.models import COMPONENTS

from .host import ERROR, NOISY, TICKS, assert_same_bits, chain, grid, host, refused

HALF = TICKS // 2
BOTH = pytest.mark.parametrize("fmi", [2, 3])
EVERY = pytest.mark.parametrize("name", COMPONENTS)

CONTINUE = """
import sys
import numpy as np
from tests.fmu.host import TICKS, grid, host
folder, fmi = sys.argv[1], int(sys.argv[2])
for name in sys.argv[3:]:
    instance = host(name, fmi)
    instance.restore(open(f"{folder}/{name}.state", "rb").read())
    inputs = np.load(f"{folder}/{name}.npy") if instance.input_names else None
    np.save(f"{folder}/{name}.out.npy", instance.run(grid(TICKS)[TICKS // 2:], inputs))
"""


@BOTH
def test_another_process_continues_to_the_bit(fmi: int, tmp_path: Path) -> None:
    expected = {}
    for name in COMPONENTS:
        inputs = chain()[name]
        instance = host(name, fmi).start(NOISY[name])
        instance.run(grid(HALF), inputs)
        (tmp_path / f"{name}.state").write_bytes(instance.save())
        rest = None if inputs is None else inputs[HALF:]
        if rest is not None:
            np.save(tmp_path / f"{name}.npy", rest)
        expected[name] = instance.run(grid(TICKS)[HALF:], rest)
    subprocess.run(
        [sys.executable, "-c", CONTINUE, str(tmp_path), str(fmi), *COMPONENTS],
        check=True, cwd=Path(__file__).parents[2],
    )
    for name in COMPONENTS:
        assert np.ptp(expected[name], axis=0).max() > 0
        assert_same_bits(np.load(tmp_path / f"{name}.out.npy"), expected[name])


@BOTH
@EVERY
def test_step_repeats_itself_after_going_back(name: str, fmi: int) -> None:
    inputs = chain()[name]
    instance = host(name, fmi).start(NOISY[name])
    instance.run(grid(HALF), inputs)
    state = instance.slave.getFMUState()
    rest = None if inputs is None else inputs[HALF:]
    first = instance.run(grid(TICKS)[HALF:], rest)
    instance.slave.setFMUState(state)
    again = instance.run(grid(TICKS)[HALF:], rest)
    instance.slave.setFMUState(state)
    short = instance.run(grid(2 * 5, 0.05, grid(TICKS)[HALF]), None if rest is None
                         else np.repeat(rest[:5], 2, axis=0))
    instance.slave.freeFMUState(state)
    assert_same_bits(again, first)
    assert_same_bits(short[1::2], first[:5])


@BOTH
@EVERY
def test_state_before_initialisation_can_be_kept_too(name: str, fmi: int) -> None:
    instance = host(name, fmi)
    expected = instance.start(NOISY[name]).run(grid(10), chain()[name])
    instance.slave.reset()
    instance.set(NOISY[name])
    saved = instance.save()
    instance.start({})
    instance.restore(saved)
    if fmi == 2:
        instance.slave.setupExperiment(startTime=0.0)
    instance.slave.enterInitializationMode()
    instance.slave.exitInitializationMode()
    assert_same_bits(instance.run(grid(10), chain()[name]), expected)


@BOTH
def test_state_of_another_component_is_refused(fmi: int) -> None:
    for name, other in (("ekf", "sequential"), ("target", "platform"), ("sequential", "ekf")):
        saved = host(other, fmi).start(NOISY[other]).save()
        instance = host(name, fmi).start(NOISY[name])
        before = instance.save()
        instance.messages.clear()
        assert refused(instance.restore, saved) == ERROR
        assert instance.name in instance.messages[-1]
        assert "state" in instance.messages[-1]
        assert instance.save() == before


def test_state_of_the_other_version_is_refused() -> None:
    saved = host("ekf", 3).start(NOISY["ekf"]).save()
    assert refused(host("ekf", 2).start().restore, saved) == ERROR


@BOTH
def test_equal_states_are_equal_bytes(fmi: int) -> None:
    one, other = host("acoustics", fmi), host("acoustics", fmi, 1)
    for instance in (one, other):
        instance.start(NOISY["acoustics"]).run(grid(20), chain()["acoustics"])
    assert one.save() == other.save()
