"""The random numbers of the printed C: the generator's words, uniform numbers, normals."""

import ctypes
import importlib.util
import math
import shutil
import subprocess
import sys
from pathlib import Path

import mpmath
import numpy as np
import pytest
from numpy.typing import NDArray
from quick import one_in

Words = NDArray[np.uint32]
Array = NDArray[np.float64]

HEADERS = Path(__file__).parents[3] / "fmus" / "c"
DRIVER = Path(__file__).with_name("elementary_driver.c")
FLAGS = "-O2 -ffp-contract=off -fno-math-errno -fvisibility=hidden -std=gnu11 -fPIC -shared"
HAS_ZIG = importlib.util.find_spec("ziglang") is not None
COMPILERS = {
    "gcc": ["gcc"] if shutil.which("gcc") else [],
    "zig": [sys.executable, "-m", "ziglang", "cc", "-mcpu=baseline"] if HAS_ZIG else [],
}
FIRST = "gcc" if COMPILERS["gcc"] else "zig"


def target_flags(lanes: int) -> list[str]:
    """The instruction set whose registers hold that many lanes, if this CPU has it."""
    info = Path("/proc/cpuinfo")
    has = set(info.read_text().split()) if info.exists() else set()
    wanted = {4: ["avx2"], 8: ["avx512f", "avx512dq"]}.get(lanes, [])
    return [f"-m{flag}" for flag in wanted] if set(wanted) <= has else []


def pointer(array: Words | Array) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


class Generator:
    """The driver compiled for one lane count."""

    def __init__(self, out: Path, compiler: str, lanes: int, wide: bool = True) -> None:
        if not COMPILERS[compiler]:
            pytest.skip(f"{compiler} is not installed")
        command = [*COMPILERS[compiler], *FLAGS.split(), f"-DLANES={lanes}", f"-I{HEADERS}"]
        command += target_flags(lanes) if wide else []
        command += ["-Wall", "-Wextra", "-Werror", "-Wno-psabi", str(DRIVER), "-o", str(out)]
        result = subprocess.run(command, capture_output=True, text=True, check=False)
        assert result.returncode == 0, result.stderr
        self.dll = ctypes.CDLL(str(out))

    def words(self, key: Words, counter: Words) -> Words:
        """Rows of two key words and four counter words; a multiple of eight rows."""
        key, counter = np.ascontiguousarray(key), np.ascontiguousarray(counter)
        out = np.empty((len(key), 4), dtype=np.uint32)
        self.dll.philox_rows(
            pointer(key), pointer(counter), pointer(out), ctypes.c_size_t(len(key))
        )
        return out

    def from_words(self, words: Words) -> tuple[Array, Array]:
        """Both 53-bit numbers and both normals of every row; a multiple of eight rows."""
        words = np.ascontiguousarray(words)
        uniforms, normals = np.empty((len(words), 2)), np.empty((len(words), 2))
        self.dll.words_rows(
            pointer(words), pointer(uniforms), pointer(normals), ctypes.c_size_t(len(words))
        )
        return uniforms, normals

    def normals(self, key: tuple[int, int], count: int) -> Array:
        """Two rows of normals, for the counters 0 to count - 1."""
        out = np.empty((2, count))
        self.dll.normals(
            pointer(np.array(key, dtype=np.uint32)), pointer(out), ctypes.c_size_t(count)
        )
        return out


@pytest.fixture(scope="module")
def generator(tmp_path_factory: pytest.TempPathFactory) -> Generator:
    return Generator(tmp_path_factory.mktemp("philox") / "one.so", FIRST, 1)


# Counter, key and words, from the known answers published with Random123.
KNOWN = [
    ("00000000 00000000 00000000 00000000", "00000000 00000000",
     "6627e8d5 e169c58d bc57ac4c 9b00dbd8"),
    ("ffffffff ffffffff ffffffff ffffffff", "ffffffff ffffffff",
     "408f276d 41c83b0e a20bc7c6 6d5451fd"),
    ("243f6a88 85a308d3 13198a2e 03707344", "a4093822 299f31d0",
     "d16cfe09 94fdcceb 5001e420 24126ea1"),
]  # fmt: skip


def from_hex(text: str) -> list[int]:
    return [int(word, 16) for word in text.split()]


def philox_python(key: list[int], counter: list[int]) -> list[int]:
    k0, k1 = key
    c0, c1, c2, c3 = counter
    for _ in range(10):
        p0, p1 = 0xD2511F53 * c0, 0xCD9E8D57 * c2
        c0, c1, c2, c3 = (
            (p1 >> 32) ^ c1 ^ k0, p1 & 0xFFFFFFFF, (p0 >> 32) ^ c3 ^ k1, p0 & 0xFFFFFFFF
        )  # fmt: skip
        k0, k1 = (k0 + 0x9E3779B9) & 0xFFFFFFFF, (k1 + 0xBB67AE85) & 0xFFFFFFFF
    return [c0, c1, c2, c3]


@pytest.mark.parametrize("wide", [True, False], ids=["wide", "baseline"])
@pytest.mark.parametrize("lanes", [1, 2, 4, 8])
@pytest.mark.parametrize("compiler", ["gcc", "zig"])
@one_in(3)
def test_every_build(
    tmp_path: Path, generator: Generator, compiler: str, lanes: int, wide: bool
) -> None:
    """Known answers, independent lanes, and the same normals to the bit."""
    build = Generator(tmp_path / "lib.so", compiler, lanes, wide)
    rng = np.random.default_rng(30)
    key = rng.integers(0, 2**32, (64, 2), dtype=np.uint32)
    counter = rng.integers(0, 2**32, (64, 4), dtype=np.uint32)
    wanted = np.empty((64, 4), dtype=np.uint32)
    for i in range(64):
        wanted[i] = philox_python(key[i].tolist(), counter[i].tolist())
    for i in range(0, 64, 3):  # known answers in any lane, beside other keys and counters
        c, k, w = KNOWN[i % 9 // 3]
        counter[i], key[i], wanted[i] = from_hex(c), from_hex(k), from_hex(w)
    np.testing.assert_array_equal(build.words(key, counter), wanted)
    for got, reference in zip(build.from_words(wanted), generator.from_words(wanted), strict=True):
        np.testing.assert_array_equal(got.view(np.uint64), reference.view(np.uint64))
    np.testing.assert_array_equal(
        build.normals((7, 9), 50_000).view(np.uint64),
        generator.normals((7, 9), 50_000).view(np.uint64),
    )


def test_uniforms_are_the_upper_53_bits(generator: Generator) -> None:
    rng = np.random.default_rng(31)
    words = rng.integers(0, 2**32, (4000, 4), dtype=np.uint32)
    edges = np.array([0, 1, 2047, 2048, 2**31, 2**32 - 2048, 2**32 - 1], dtype=np.uint32)
    words[:2000] = rng.choice(edges, (2000, 4))
    wide = words.astype(np.uint64)
    wanted = (wide[:, ::2] << np.uint64(21)) | (wide[:, 1::2] >> np.uint64(11))
    np.testing.assert_array_equal(generator.from_words(words)[0], wanted.astype(np.float64))


def test_normals_follow_the_formula(generator: Generator) -> None:
    rng = np.random.default_rng(32)
    words = rng.integers(0, 2**32, (1000, 4), dtype=np.uint32)
    words[:100, 0] = 2**32 - 1 - np.arange(100)  # radii close to zero
    words[100:200, 0] = 0  # large radii
    uniforms, normals = generator.from_words(words)
    worst = 0.0
    with mpmath.workprec(120):
        for (k0, k1), pair in zip(uniforms.tolist(), normals.tolist(), strict=True):
            radius = mpmath.sqrt(-2 * mpmath.log(mpmath.ldexp(mpmath.mpf(k0) + 1, -53)))
            angle = mpmath.ldexp(mpmath.mpf(k1), -52)
            exact = (radius * mpmath.cospi(angle), radius * mpmath.sinpi(angle))
            for got, want in zip(pair, exact, strict=True):
                worst = max(worst, float(abs(got - want) / math.ulp(float(want))))
    print(f"normals: {worst:.3f} ulp")
    assert worst <= 4


def test_extreme_words(generator: Generator) -> None:
    words = np.zeros((8, 4), dtype=np.uint32)
    words[1, :2] = 2**32 - 1
    words[2] = 2**32 - 1
    words[3, 2] = 2**30
    normals = generator.from_words(words)[1]
    largest = math.sqrt(2 * 53 * math.log(2))
    assert normals[0].tolist() == pytest.approx([largest, 0], rel=1e-15)
    assert np.all(normals[1:3] == 0)
    assert normals[3].tolist() == pytest.approx([0, largest], rel=1e-15)


# ---- the distribution ----

COUNT = 2**21  # pairs


@pytest.fixture(scope="module")
def draws(generator: Generator) -> Array:
    return generator.normals((0x5B1C, 0x0C05), COUNT)


def normal_cdf(x: Array) -> Array:
    return np.array([0.5 * math.erfc(-v / math.sqrt(2)) for v in x.tolist()])


def test_moments(draws: Array) -> None:
    """Within 4 standard errors of the standard normal's moments."""
    x = draws.ravel()
    n = len(x)
    assert abs(np.mean(x)) < 4 / math.sqrt(n)
    assert abs(np.mean(x**2) - 1) < 4 * math.sqrt(2 / n)
    assert abs(np.mean(x**3)) < 4 * math.sqrt(15 / n)
    assert abs(np.mean(x**4) - 3) < 4 * math.sqrt(96 / n)
    assert abs(np.mean(x**6) - 15) < 4 * math.sqrt((10395 - 225) / n)


@pytest.mark.parametrize("limit", [1, 2, 3, 4, 4.5])
@pytest.mark.parametrize("side", [-1, 1])
def test_tails(draws: Array, limit: float, side: int) -> None:
    expected = draws.size * 0.5 * math.erfc(limit / math.sqrt(2))
    count = int(np.count_nonzero(side * draws > limit))
    assert abs(count - expected) < 4 * math.sqrt(expected)


def test_anderson_darling(draws: Array) -> None:
    """Against the fully specified normal; 3.857 is the 1 % point, whatever the number."""
    x = np.sort(draws[:, :100_000].ravel())
    n = len(x)
    weights = (2 * np.arange(1, n + 1) - 1) / n
    statistic = -n - np.sum(weights * np.log(normal_cdf(x) * normal_cdf(-x[::-1])))
    assert statistic < 3.857


def test_pairs_and_neighbours_are_uncorrelated(draws: Array) -> None:
    a, b = draws
    limit = 4 / math.sqrt(COUNT)
    assert abs(np.mean(a * b)) < limit
    assert abs(np.mean((a**2 - 1) * (b**2 - 1))) < 2 * limit
    for lag in (1, 2, 8):
        assert abs(np.mean(a[lag:] * a[:-lag])) < limit
        assert abs(np.mean(a[lag:] * b[:-lag])) < limit
        assert abs(np.mean((a[lag:] ** 2 - 1) * (a[:-lag] ** 2 - 1))) < 2 * limit


def test_keys_are_independent(generator: Generator) -> None:
    n = 2**19
    one, other = generator.normals((1, 0), n).ravel(), generator.normals((2, 0), n).ravel()
    assert abs(np.mean(one * other)) < 4 / math.sqrt(2 * n)
