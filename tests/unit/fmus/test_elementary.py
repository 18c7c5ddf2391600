"""The elementary functions of the printed C: accuracy, special values, equal bits."""

import ctypes
import functools
import importlib.util
import math
import platform
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from numpy.typing import NDArray
from quick import one_in

Array = NDArray[np.float64]

HEADERS = Path(__file__).parents[3] / "fmus" / "c"
DRIVER = Path(__file__).with_name("elementary_driver.c")
FLAGS = [
    "-O2",
    "-ffp-contract=off",
    "-fno-math-errno",
    "-fvisibility=hidden",
    "-std=gnu11",
    "-fPIC",
]
WARNINGS = ["-Wall", "-Wextra", "-Werror", "-Wno-psabi"]
GCC = shutil.which("gcc")
HAS_ZIG = importlib.util.find_spec("ziglang") is not None
# The CPU must be named to zig, which otherwise builds for the one it runs on.
ZIG = [sys.executable, "-m", "ziglang", "cc"]
COMPILERS = {"gcc": [GCC] if GCC else [], "zig": [*ZIG, "-mcpu=baseline"] if HAS_ZIG else []}
FIRST = "gcc" if GCC else "zig"
INF, NAN = math.inf, math.nan
UNARY = ["sin", "cos", "tan", "exp", "log", "atan", "asin", "acos"]
UNARY += ["sqrt", "fabs", "sign", "floor", "ceil", "not", "negate"]
BINARY = ["atan2", "fmod", "fmin", "fmax", "copysign", "lt"]
BINARY += ["min", "max", "le", "eq", "ne", "and", "or", "keep_true"]


@functools.cache
def cpu_flags() -> frozenset[str]:
    info = Path("/proc/cpuinfo")
    text = info.read_text() if info.exists() else ""
    return frozenset(next((x for x in text.splitlines() if x.startswith("flags")), "").split())


def target_flags(lanes: int) -> list[str]:
    """The instruction set whose registers hold that many lanes, if this CPU has it."""
    wanted = {4: ["avx2"], 8: ["avx512f", "avx512dq"]}.get(lanes, [])
    return [f"-m{flag}" for flag in wanted] if set(wanted) <= cpu_flags() else []


def compile_driver(compiler: str, lanes: int, out: Path, *extra: str) -> Path:
    if not COMPILERS[compiler]:
        pytest.skip(f"{compiler} is not installed")
    command = [*COMPILERS[compiler], *FLAGS, *WARNINGS, f"-DLANES={lanes}", f"-I{HEADERS}"]
    command += [*extra, "-shared", str(DRIVER), "-o", str(out)]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    assert "warning" not in result.stderr
    return out


class Library:
    """The driver compiled for one lane count."""

    def __init__(self, path: Path) -> None:
        self.dll = ctypes.CDLL(str(path))

    def __call__(self, name: str, *arguments: Iterable[float] | Array, results: int = 1) -> Any:
        """Apply map_<name> to arrays of one length (padded to the driver's multiple of 8)."""
        arrays = [np.asarray(a, dtype=np.float64) for a in arguments]
        count = len(arrays[0])
        padded = [np.resize(a, -(-count // 8) * 8) for a in arrays]
        outs = [np.empty_like(padded[0]) for _ in range(results)]
        pointers = [ctypes.c_void_p(a.ctypes.data) for a in padded + outs]
        getattr(self.dll, f"map_{name}")(*pointers, ctypes.c_size_t(len(padded[0])))
        return outs[0][:count] if results == 1 else [out[:count] for out in outs]


@pytest.fixture(scope="module")
def lib(tmp_path_factory: pytest.TempPathFactory) -> Library:
    path = tmp_path_factory.mktemp("elementary") / "one.so"
    return Library(compile_driver(FIRST, 1, path))


# ---- accuracy ----

N = 60_000
BOUNDS = {"sin": 1.0, "cos": 1.0, "tan": 1.5, "exp": 1.0, "log": 1.0}
BOUNDS |= {"atan": 1.5, "atan2": 1.5, "asin": 1.0, "acos": 1.0, "sincos_turn": 1.5}
NUMPY = {"atan": "arctan", "atan2": "arctan2", "asin": "arcsin", "acos": "arccos"}


def ulps(got: float, exact: Any) -> float:
    return float(abs(mpmath.mpf(got) - exact) / mpmath.mpf(math.ulp(float(exact))))


def worst_against_mpmath(
    got: Array, function: Callable[..., Any], arguments: tuple[Array, ...]
) -> float:
    with mpmath.workprec(200):
        rows = zip(got, *arguments, strict=True)
        return max(ulps(float(y), function(*map(mpmath.mpf, map(float, x)))) for y, *x in rows)


def worst_ulp(lib: Library, name: str, *arguments: Array) -> float:
    """Largest error: of all points in long double, of the worst and some others in mpmath."""
    got = lib(name, *arguments)
    picks = np.arange(0, len(got), len(got) // 400)
    screened = 0.0
    if np.finfo(np.longdouble).nmant >= 63:
        exact = getattr(np, NUMPY.get(name, name))(*(a.astype(np.longdouble) for a in arguments))
        error = np.abs(got - exact) / np.abs(np.spacing(np.abs(exact).astype(np.float64)))
        screened = float(np.max(error))
        picks = np.union1d(picks, np.argsort(error)[-200:])
    exactly = worst_against_mpmath(
        got[picks], getattr(mpmath, name), tuple(a[picks] for a in arguments)
    )
    assert screened <= exactly + 0.01  # long double sufficed to find the worst
    return exactly


def hardest_angles() -> Array:
    """For every exponent, the doubles up to 5e7 that come closest to multiples of pi/2.

    They are the numerators of convergents: m 2^e ~ n pi/2 when n/m ~ 2^e / (pi/2).
    """
    found: set[float] = set()
    with mpmath.workprec(400):
        for exponent in range(-53, -26):
            rest = mpmath.ldexp(1, exponent) * 2 / mpmath.pi
            before, m = 0, 1
            while m < 2**53:
                if math.pi / 4 < math.ldexp(m, exponent) <= 5e7:
                    found.add(math.ldexp(m, exponent))
                rest = 1 / (rest - mpmath.floor(rest))
                before, m = m, int(mpmath.floor(rest)) * m + before
    return np.array(sorted(found))


def sample(name: str) -> tuple[Array, ...]:
    rng = np.random.default_rng(20)
    one = rng.uniform(-1, 1, N)
    tiny = one * np.exp2(rng.uniform(-60, 0, N))
    wide = one * np.exp2(rng.uniform(-300, 300, N))
    if name in ("sin", "cos", "tan"):
        return (np.concatenate([2 * one, 10 * one, 1e3 * one, tiny]),)
    if name == "exp":
        return (np.concatenate([0.4 * one, 20 * one, 708 * one, tiny, [709.78, -708.39]]),)
    if name == "log":
        subnormal = np.abs(one) * 2.0**-1022
        near_one = np.concatenate([1 + tiny, 1 + one / 2, 1 + np.arange(-500, 500) * 2.0**-53])
        return (np.concatenate([near_one[near_one != 1], np.abs(wide), subnormal]),)
    if name == "atan":
        return (np.concatenate([one, 10 * one, wide, 1 / (2 + one)]),)
    if name == "atan2":
        y = np.concatenate([one, 10 * one, wide, tiny])
        return y, np.concatenate([rng.permutation(one), one, rng.permutation(wide), one])
    edge = 1 - np.abs(tiny)
    return (np.concatenate([one, tiny, edge, -edge, 0.5 + tiny / 64]),)


@pytest.mark.parametrize("name", [name for name in BOUNDS if name != "sincos_turn"])
def test_accuracy(lib: Library, name: str, record_property: Callable[[str, object], None]) -> None:
    worst = worst_ulp(lib, name, *sample(name))
    record_property(f"worst ulp of {name}", worst)
    print(f"{name}: {worst:.3f} ulp")
    assert worst <= BOUNDS[name]


@pytest.mark.parametrize("name", ["sin", "cos", "tan"])
def test_accuracy_at_large_and_hard_angles(lib: Library, name: str) -> None:
    rng = np.random.default_rng(21)
    hard = hardest_angles()
    quarters = np.concatenate([np.arange(1, 1500), rng.integers(1500, 31_830_988, 1500)])
    near = quarters * (math.pi / 2)
    boundaries = (quarters + 0.5) * (math.pi / 2)
    x = np.concatenate(
        [hard, near, np.nextafter(near, 0), np.minimum(boundaries, 5e7), rng.uniform(0, 5e7, 2000)]
    )
    assert np.min(np.abs(np.cos(hard))) < 1e-16
    x = x * rng.choice([-1, 1], len(x))
    worst = worst_against_mpmath(lib(name, x), getattr(mpmath, name), (x,))
    print(f"{name}, hard: {worst:.3f} ulp")
    assert worst <= BOUNDS[name]


def test_sincos_turn(lib: Library, record_property: Callable[[str, object], None]) -> None:
    rng = np.random.default_rng(22)
    integers = rng.integers(0, 2**53, 3000) * 2.0**-53
    eighths = (np.arange(8)[:, None] / 8 + np.arange(0, 100) * 2.0**-53).ravel()
    u = np.concatenate([integers, eighths, 1 - np.arange(1, 100) * 2.0**-53, [2.0**-53]])
    s, c = lib("sincos_turn", u, results=2)
    worst = max(
        worst_against_mpmath(s, lambda v: mpmath.sinpi(2 * v), (u,)),
        worst_against_mpmath(c, lambda v: mpmath.cospi(2 * v), (u,)),
    )
    record_property("worst ulp of sincos_turn", worst)
    print(f"sincos_turn: {worst:.3f} ulp")
    assert worst <= BOUNDS["sincos_turn"]
    s, c = lib("sincos_turn", [0, 0.25, 0.5, 0.75], results=2)
    assert s.tolist() == [0, 1, 0, -1]
    assert c.tolist() == [1, 0, -1, 0]


def test_exp_of_subnormal_result(lib: Library) -> None:
    x = np.linspace(-745.14, -708.39, 3001)
    with mpmath.workprec(200):
        errors = [
            abs(mpmath.mpf(float(y)) - mpmath.exp(mpmath.mpf(float(v))))
            for v, y in zip(x, lib("exp", x), strict=True)
        ]
    assert max(errors) <= mpmath.ldexp(1, -1074)


# ---- special values ----


def same(got: Array, wanted: Iterable[float]) -> None:
    """Equal with the signs of zeros; NaN equals NaN."""
    expected = np.asarray(list(wanted), dtype=np.float64)
    np.testing.assert_array_equal(got, expected)
    number = ~np.isnan(expected)
    np.testing.assert_array_equal(np.signbit(got)[number], np.signbit(expected)[number])


def test_special_values(lib: Library) -> None:
    big = float(np.finfo(np.float64).max)
    tiny = 5e-324
    same(lib("sin", [0.0, -0.0, INF, -INF, NAN]), [0.0, -0.0, NAN, NAN, NAN])
    same(lib("cos", [0.0, -0.0, INF, -INF, NAN]), [1, 1, NAN, NAN, NAN])
    same(lib("tan", [0.0, -0.0, INF, NAN]), [0.0, -0.0, NAN, NAN])
    same(lib("exp", [0.0, -0.0, INF, -INF, NAN]), [1, 1, INF, 0, NAN])
    same(lib("exp", [709.79, 1e300, -745.14, -746, -1e300]), [INF, INF, 0, 0, 0])
    assert lib("exp", [-745.13])[0] == tiny
    assert math.isfinite(lib("exp", [709.78])[0])
    same(lib("log", [1, 0.0, -0.0, -tiny, -1, -INF, INF, NAN]),
         [0.0, -INF, -INF, NAN, NAN, NAN, INF, NAN])  # fmt: skip
    assert lib("log", [tiny])[0] == pytest.approx(-1074 * math.log(2), rel=1e-15)
    same(lib("atan", [0.0, -0.0, INF, -INF, NAN, 1, -1, big, tiny]),
         [0.0, -0.0, math.pi / 2, -math.pi / 2, NAN, math.pi / 4, -math.pi / 4,
          math.pi / 2, tiny])  # fmt: skip
    same(lib("asin", [0.0, -0.0, 1, -1, 1.0000000000000002, -2, INF, NAN]),
         [0.0, -0.0, math.pi / 2, -math.pi / 2, NAN, NAN, NAN, NAN])  # fmt: skip
    same(lib("acos", [0.0, -0.0, 1, -1, 1.0000000000000002, -2, INF, NAN]),
         [math.pi / 2, math.pi / 2, 0.0, math.pi, NAN, NAN, NAN, NAN])  # fmt: skip


@pytest.mark.parametrize("name", ["sin", "cos"])
def test_sine_beyond_its_domain_stays_bounded(lib: Library, name: str) -> None:
    x = np.concatenate([np.nextafter(5e7, 1e8) * np.exp2(np.arange(0, 998, 0.7)), [1.7e308]])
    assert np.all(np.abs(lib(name, np.concatenate([x, -x]))) <= 1)


def test_atan2_agrees_with_c_on_axes_and_infinities(lib: Library) -> None:
    values = [0.0, -0.0, 1.0, -1.0, 5e-324, -5e-324, 1e308, -1.7e308, INF, -INF, 2.0, NAN]
    y, x = (a.ravel() for a in np.meshgrid(values, values))
    got = lib("atan2", y, x)
    wanted = np.array([math.atan2(a, b) for a, b in zip(y, x, strict=True)])
    np.testing.assert_array_equal(np.isnan(got), np.isnan(wanted))
    number = ~np.isnan(wanted)
    np.testing.assert_array_equal(np.signbit(got)[number], np.signbit(wanted)[number])
    np.testing.assert_allclose(got, wanted, rtol=3e-16, atol=0)
    exact = (y == 0) | (x == 0) | (np.abs(y) == np.abs(x)) | np.isinf(y) | np.isinf(x)
    np.testing.assert_array_equal(got[exact], wanted[exact])


# ---- the arithmetic helpers ----

MIXED = [0.0, -0.0, 1.0, -1.0, 0.5, -0.5, 2.5, -2.5, 0.3, -0.3, 1e15 + 0.5, 2.0**52 - 0.5]
MIXED += [-(2.0**52) + 0.5, 2.0**53, -(2.0**60), 1e300, -1e300, 5e-324, -5e-324, 1 - 2.0**-53]
MIXED += [4503599627370495.5, 4503599627370497.0, INF, -INF, NAN]


def pairs() -> tuple[Array, Array]:
    a, b = np.meshgrid(MIXED, MIXED)
    return a.ravel(), b.ravel()


def test_rounding_and_sign(lib: Library) -> None:
    rng = np.random.default_rng(23)
    x = np.concatenate([MIXED, rng.uniform(-10, 10, 1000), rng.normal(size=1000) * 2.0**51])
    same(lib("floor", x), np.floor(x))
    same(lib("ceil", x), np.ceil(x))
    same(lib("fabs", x), np.abs(x))
    same(lib("negate", x), -x)
    same(lib("sign", x), [v if v == 0 or v != v else math.copysign(1, v) for v in x])
    with np.errstate(invalid="ignore"):
        same(lib("sqrt", x), np.sqrt(x))
    same(lib("access", x), x)


def test_comparisons_and_selection(lib: Library) -> None:
    a, b = pairs()
    same(lib("lt", a, b), a < b)
    same(lib("le", a, b), a <= b)
    same(lib("eq", a, b), a == b)
    same(lib("ne", a, b), a != b)
    same(lib("and", a, b), (a != 0) & (b != 0))
    same(lib("or", a, b), (a != 0) | (b != 0))
    same(lib("not", a), a == 0)
    same(lib("copysign", a, b), np.copysign(a, b))
    same(lib("keep_true", a, b), np.where(a != 0, b, 0.0))
    same(lib("blend", a, b, a[::-1]), np.where(a != 0, b, a[::-1]))
    same(lib("fmin", a, b), np.where((a < b) | np.isnan(b), a, b))
    same(lib("fmax", a, b), np.where((a > b) | np.isnan(b), a, b))
    same(lib("min", a, b), np.where(a < b, a, b))
    same(lib("max", a, b), np.where(a > b, a, b))
    np.testing.assert_array_equal(lib("fmin", a, b), np.fmin(a, b))
    np.testing.assert_array_equal(lib("fmax", a, b), np.fmax(a, b))


def test_fmod(lib: Library) -> None:
    rng = np.random.default_rng(24)
    n = 20_000
    y = rng.normal(size=n) * np.exp2(rng.uniform(-1060, 900, n))
    quotient = rng.uniform(-1, 1, n) * np.exp2(rng.uniform(-3, 52.9, n))
    quotient[::3] = np.rint(quotient[::3])
    with np.errstate(all="ignore"):
        x = y * quotient
        x[1::2] = np.nextafter(x[1::2], 0)  # just below a multiple, or so
        fine = np.isfinite(x) & (np.abs(x) < 2.0**990) & (np.abs(x / y) < 2.0**53)
    x, y = x[fine], y[fine]
    same(lib("fmod", x, y), np.fmod(x, y))
    same(lib("fmod", [5, -5, -0.0, 6, -6, 1, 1e308], [3, 3, 1, 3, 3, INF, 1.5e308]),
         [2, -2, -0.0, 0.0, -0.0, 1, 1e308])  # fmt: skip
    same(lib("fmod", [1, INF, NAN, 1, 1e300, 1e308], [0, 1, 1, NAN, 1, 1e307]), [NAN] * 6)


# ---- the same bits everywhere ----


def canonical(values: Array) -> NDArray[np.uint64]:
    """The bits, but one NaN for all: its sign and payload are the processor's choice."""
    return np.where(np.isnan(values), np.nan, values).view(np.uint64)


def everything(lib: Library) -> dict[str, NDArray[np.uint64]]:
    rng = np.random.default_rng(25)
    any_bits = rng.integers(0, 2**64, 8000, dtype=np.uint64).view(np.float64)
    a, b = pairs()
    x = np.concatenate([rng.normal(size=20_000) * 3, rng.uniform(-1, 1, 8000), any_bits, a])
    x = np.concatenate([x, rng.uniform(-800, 800, 5000), rng.uniform(-1e6, 1e6, 8000)])
    y = np.concatenate([rng.permutation(x[: len(x) - len(b)]), b])
    results = {name: canonical(lib(name, x)) for name in UNARY}
    results |= {name: canonical(lib(name, x, y)) for name in BINARY}
    results["blend"] = canonical(lib("blend", x, y, x[::-1]))
    turns = rng.uniform(size=8000)
    results["sincos_turn"] = canonical(np.concatenate(lib("sincos_turn", turns, results=2)))
    s, c = lib("sincos", x, results=2)
    np.testing.assert_array_equal(canonical(s), results["sin"])
    np.testing.assert_array_equal(canonical(c), results["cos"])
    return results


RARE = {("gcc", 2), ("zig", 1), ("zig", 2), ("zig", 4)}
"""What only the slow tests compile."""


@pytest.fixture(scope="module")
def reference(lib: Library) -> dict[str, NDArray[np.uint64]]:
    return everything(lib)


@one_in(2)
@pytest.mark.parametrize("plain", [False, True], ids=["wide", "baseline"])
@pytest.mark.parametrize(("compiler", "lanes"), [
    pytest.param(compiler, lanes, marks=[pytest.mark.slow] if (compiler, lanes) in RARE else [])
    for compiler in ("gcc", "zig") for lanes in (1, 2, 4, 8)
])
def test_same_bits(
    tmp_path: Path,
    reference: dict[str, NDArray[np.uint64]],
    compiler: str,
    lanes: int,
    plain: bool,
) -> None:
    flags = [] if plain else target_flags(lanes)
    if not plain and not flags and lanes > 2:
        pytest.skip("this CPU has no registers of that width")
    if not plain and lanes <= 2:
        # Nothing to widen; instead offer fused multiply-add, which must not be used.
        if "fma" not in cpu_flags():
            pytest.skip("this CPU has no fused multiply-add")
        flags = ["-mavx2", "-mfma"]
    library = Library(compile_driver(compiler, lanes, tmp_path / "lib.so", *flags))
    assert library.dll.lanes() == lanes
    for name, bits in everything(library).items():
        np.testing.assert_array_equal(bits, reference[name], err_msg=name)
    for lane in range(8):
        x = np.zeros(8)
        assert library.dll.any_nonzero(ctypes.c_void_p(x.ctypes.data), ctypes.c_size_t(8)) == 0
        x[lane] = NAN if lane % 2 else -5e-324
        assert library.dll.any_nonzero(ctypes.c_void_p(x.ctypes.data), ctypes.c_size_t(8)) == 1


@pytest.mark.skipif(not HAS_ZIG, reason="ziglang is not installed")
@pytest.mark.parametrize("lanes", [1, 8])
def test_compiles_for_aarch64(tmp_path: Path, lanes: int) -> None:
    command = [*ZIG, "-target", "aarch64-linux-gnu", *FLAGS, *WARNINGS, f"-DLANES={lanes}"]
    command += [f"-I{HEADERS}", "-c", str(DRIVER), "-o", str(tmp_path / "driver.o")]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr


UBSAN_RUN = """
import ctypes, itertools, math, sys
dll = ctypes.CDLL(sys.argv[1])
values = [0.0, -0.0, 1.5, -7e5, 1e300, -1e300, 5e-324, 2.0**52, math.inf, -math.inf, math.nan, 3]
rows = list(zip(*itertools.product(values, values)))
arrays = [(ctypes.c_double * 144)(*row) for row in rows]
out, n = (ctypes.c_double * 144)(), ctypes.c_size_t(144)
for name in sys.argv[2].split():
    getattr(dll, "map_" + name)(arrays[0], out, n)
for name in sys.argv[3].split():
    getattr(dll, "map_" + name)(*arrays, out, n)
key = (ctypes.c_uint32 * 2)(0xFFFFFFFF, 0x80000000)
dll.normals(key, (ctypes.c_double * 128)(), ctypes.c_size_t(64))
"""


@pytest.mark.skipif(GCC is None or platform.system() != "Linux", reason="needs gcc's UBSan")
@pytest.mark.parametrize("lanes", [1, 4])
def test_no_undefined_behaviour(tmp_path: Path, lanes: int) -> None:
    # GCC guesses wrongly about initialisation once the checks are in, so no warnings here.
    flags = ["-w", "-fsanitize=undefined", "-fno-sanitize-recover=all"]
    probe = tmp_path / "probe.c"
    probe.write_text("int probe(int a) { return a + 1; }\n")
    command = ["gcc", *flags, "-shared", "-fPIC", str(probe), "-o", str(tmp_path / "probe.so")]
    if subprocess.run(command, capture_output=True, check=False).returncode != 0:
        pytest.skip("gcc has no UBSan runtime here")
    library = compile_driver("gcc", lanes, tmp_path / "lib.so", *flags)
    script = [sys.executable, "-c", UBSAN_RUN, str(library), " ".join(UNARY), " ".join(BINARY)]
    result = subprocess.run(script, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    assert "runtime error" not in result.stderr
