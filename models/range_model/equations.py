"""Equations of the range model: the ranges in z and their rows of H (the paper's section 3)."""

from __future__ import annotations

from typing import Any

import casadi as ca

from ..equations import Equations, Symbols, Values


def _output(p: Symbols, x: Symbols, u: Symbols, t: Any) -> Values:
    offsets = [u.position - u.beacon_position[i, :].T for i in range(p.beacons)]
    return {"range": ca.vertcat(*(ca.sqrt(ca.sumsqr(d)) for d in offsets))}


EQUATIONS = Equations(output=_output)
