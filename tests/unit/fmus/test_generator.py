"""What the generator leaves out: work that no lane needs, and copies."""

from __future__ import annotations

import re
from math import prod

import casadi as ca
import pytest
from quick import one_in
from sblcosim.fmus.build.generator import model_source, state_indices
from sblcosim.fmus.build.straight_line import statements
from sblcosim.models import COMPONENTS, RECEIVERS
from sblcosim.models.loading import load


def lines(expression: ca.SX, *arguments: ca.SX) -> list[str]:
    function = ca.Function("f", [ca.vertcat(*arguments)], [expression])
    return statements(function, ["a"], "y")


def test_an_elementary_function_that_no_lane_needs_is_not_computed() -> None:
    c, x = ca.SX.sym("c"), ca.SX.sym("x")
    text = lines(ca.if_else(c > 0, ca.log(x), 0), c, x)
    begin, end = next(i for i, line in enumerate(text) if "m_any" in line), text.index("}")
    assert any("r_log" in line for line in text[begin:end])
    assert not any("r_log" in line for line in text[:begin] + text[end:])


def test_what_is_needed_outside_of_a_branch_too_is_made_outside() -> None:
    c, x = ca.SX.sym("c"), ca.SX.sym("x")
    log = ca.log(x)
    text = lines(ca.vertcat(ca.if_else(c > 0, log, 0), log), c, x)
    assert not any("m_any" in line for line in text)


def test_a_state_that_changes_only_under_a_condition_is_chosen_once() -> None:
    c, x = ca.SX.sym("c"), ca.SX.sym("x")
    changed = ca.Function("f", [ca.vertcat(c, x)], [ca.vertcat(c, ca.if_else(c > 0, 2 * x, x))])
    text = statements(changed, ["x"], "x", "going")
    assert [line for line in text if "r_blend" in line] == [text[-1]]
    condition = next(line.split()[2] for line in text if "m_lt" in line)
    assert text[-1].startswith(f"x[1] = r_blend(going & {condition}, ")


def test_a_choice_without_an_elementary_function_is_no_branch() -> None:
    c, x = ca.SX.sym("c"), ca.SX.sym("x")
    assert not any("m_any" in line for line in lines(ca.if_else(c > 0, x * x, 0), c, x))


def test_the_larger_of_a_value_and_a_constant_needs_no_look_for_a_nan() -> None:
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    of_constant = "\n".join(lines(ca.vertcat(ca.fmax(x, 1e-24), ca.fmin(x, 2.0)), x, y))
    assert "r_max(" in of_constant
    assert "r_min(" in of_constant
    assert "r_f" not in of_constant
    others = "\n".join(lines(ca.vertcat(ca.fmax(x, y), ca.fmin(1.0, y), ca.fmin(x, 1 / y)), x, y))
    assert others.count("r_fm") == 3


def test_each_sine_and_cosine_is_declared_once() -> None:
    """CasADi does not merge equal nodes: one argument may have several sines and cosines."""
    x = ca.SX.sym("x")
    angles = [ca.cos(x), ca.sin(x), ca.sin(x), ca.cos(x), ca.sin(x)]
    text = "\n".join(lines(ca.vertcat(*(k * v for k, v in enumerate(angles, 2))), x))
    declared = re.findall(r"(?:real |, )(a\d+)(?=[ ,;])", text)
    assert sorted(set(declared)) == sorted(declared)
    assert set(re.findall(r"a\d+", text)) == set(declared)


@one_in(2)
@pytest.mark.parametrize("name", COMPONENTS)
def test_each_state_has_a_place_of_its_own(name: str) -> None:
    places = state_indices(load(name))
    assert len(set(places)) == len(places)


def test_a_state_that_is_an_output_is_kept_once() -> None:
    model = load("acoustics")
    outputs = sum(v.size for v in model.component.of("output"))
    known = {v.name for v in model.component.of("output")}
    others = [shape for name, shape in model.states.items() if name not in known]
    assert sorted(state_indices(model)) == [*range(outputs + sum(map(prod, others)))]


@one_in(2)
@pytest.mark.parametrize("name", COMPONENTS)
def test_variants_are_selected_where_there_are_several(name: str) -> None:
    model = load(name)
    assert ("switch (variant)" in model_source(model)) == (len(model.variants) > 1)


@one_in(2)
@pytest.mark.parametrize("name", [*RECEIVERS, "acoustics"])
def test_outputs_that_never_change_are_written_at_the_start_alone(name: str) -> None:
    """Of the raw fix, which has no velocity, more than half of the covariance."""
    model = load(name)
    written = {
        part: set(re.findall(r"x\[(\d+)\] = ", _body(model_source(model), f"model_{part}(")))
        for part in ("initial", "output")
    }
    (functions,) = model.variants.values()
    arguments = [ca.SX.sym("a", *functions.output.size_in(i)) for i in range(4)]
    values = functions.output(*arguments)
    constant = {str(i) for i in range(values.numel()) if values[i].is_constant()}
    assert constant <= written["initial"]
    assert not constant & written["output"]
    assert len(constant) == {"multilateration": 30}.get(name, len(constant))


def _body(source: str, name: str) -> str:
    return source[source.index(name) :].partition("\n}\n")[0]
