"""Python functions in place of the simulation."""

from __future__ import annotations

import hashlib
import pickle
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sblcosim.errors import ConfigurationError
from sblcosim.study.distributions import distribution_of
from sblcosim.study.space import DrawnFactor, sample
from sblcosim.study.stand_in import evaluate, model_of

FACTORS = (
    DrawnFactor("gps", distribution_of("uniform", range=[1, 2])),
    DrawnFactor("receiver", distribution_of("choice", levels=["ekf", "ukf"])),
)
DRAWN = sample(FACTORS, 16, seed=5)
FILE = """
import math
from dataclasses import dataclass

def product(gps, receiver, seed, scale=2.0):
    return scale * gps * (3 if receiver == "ekf" else 5) + seed

def plain(gps, receiver):
    return math.nan if receiver == "ekf" else gps

def greedy(**values):
    return len(values)

def other(gpss, receiver):
    return 0.0

def needy(gps, receiver, depth):
    return 0.0

def text(gps, receiver):
    return receiver

def divided(gps, receiver):
    return 1 / (gps - gps)
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "mine.py").write_text(FILE)
    return tmp_path


def test_a_function_gets_each_run_by_the_names_of_the_factors_and_its_seed(folder: Path) -> None:
    model = model_of("mine.py:product", folder)
    values = DRAWN.table()
    factor = values["receiver"].map({"ekf": 6.0, "ukf": 10.0})
    assert (evaluate(model, DRAWN) == values["gps"] * factor + values["seed"]).all()
    assert model.is_random
    plain = model_of("mine.py:plain", folder)
    assert not plain.is_random
    found = evaluate(plain, DRAWN)
    assert (np.isnan(found) == (values["receiver"] == "ekf")).all()
    assert (found[~np.isnan(found)] == values["gps"][values["receiver"] == "ukf"]).all()
    assert set(evaluate(model_of("mine.py:greedy", folder), DRAWN)) == {2.0}


def test_another_seed_changes_what_a_random_function_returns_only(folder: Path) -> None:
    other = replace(DRAWN, seeds=DRAWN.seeds + 1)
    for name, change in (("product", 1.0), ("plain", 0.0)):
        model = model_of(f"mine.py:{name}", folder)
        gap = evaluate(model, other) - evaluate(model, DRAWN)
        assert set(gap[np.isfinite(gap)]) == {change}


def test_a_file_is_known_by_its_hash_and_a_function_by_its_source(folder: Path) -> None:
    model = model_of("mine.py:plain", folder)
    assert (model.name, model.origin) == ("plain", "mine.py:plain")
    assert model.sha256 == hashlib.sha256(FILE.encode()).hexdigest()

    def mine(gps, receiver):
        return gps

    def changed(gps, receiver):
        return gps + 1

    assert len({model_of(f).sha256 for f in (mine, changed)}) == 2
    assert model_of(mine).sha256 == model_of(mine).sha256


def test_it_travels_by_value(folder: Path) -> None:
    model = model_of("mine.py:product", folder)
    packed = pickle.dumps(model)
    (folder / "mine.py").unlink()
    again = pickle.loads(packed)
    assert (again.origin, again.sha256, again.is_random) == (model.origin, model.sha256, True)
    assert (evaluate(again, DRAWN) == evaluate(model, DRAWN)).all()
    assert repr(again) == "<function product from mine.py:product in place of the simulation>"


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("mine.py", "model: must be FILE.py:FUNCTION, got 'mine.py'"),
        ("mime.py:plain", "model: 'mime.py:plain' must be FILE.py:FUNCTION, got no Python file "
                          "'.*mime.py'; did you mean 'mine.py'.*"),
        ("mine.py:plane", "model: 'mine.py:plane' must name a function of 'mine.py', got 'plane'; "
                          "did you mean 'plain'.*"),
        (7, "model: must be FILE.py:FUNCTION or a function, got 7"),
        ("mine.py:other", "model: other must take the factor 'gps' by its name, got the parameters "
                          "gpss, receiver; did you mean 'gpss'.*"),
        ("mine.py:needy", "model: needy must have a default for 'depth', which is no factor, got "
                          "none"),
        ("mine.py:text", "model: text must return a number, got '.kf' at gps 1.*, receiver .kf"),
        ("mine.py:divided", r"model: divided must not raise an exception, got ZeroDivisionError: "
                            r"float division by zero \(mine.py, line 24\) at gps 1.*"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_in_one_line(source, message: str, folder: Path) -> None:
    with pytest.raises(ConfigurationError) as caught:
        evaluate(model_of(source, folder), DRAWN)
    assert re.fullmatch(message, str(caught.value)), caught.value
