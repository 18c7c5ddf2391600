"""Changes of code that a run must be known by, and differences that it must not be known by.

Each is a module with `target`, in which VALUE stands for one of two texts. Where the source is a
dict it is several files, the first of them with `target`.
"""

# ruff: noqa: E501
from __future__ import annotations

Files = dict[str, str]

CLASS = """
class target:
    def do_step(self, t, h):
        return {}
"""


def method(*lines: str, before: str = "") -> str:
    """A class with these lines in it."""
    return f"{before}\nclass target:\n" + "".join(f"    {line}\n" for line in lines)


ONE_TWO = ("1", "2")

CHANGES: dict[str, tuple[str | Files, tuple[str, str]]] = {
    "code of a function": ("def target():\n    return VALUE\n", ONE_TWO),
    "an operation": ("def target(x):\n    return x VALUE 2\n", ("+", "-")),
    "an attribute's name": ("def target(x):\n    return x.VALUE\n", ("real", "imag")),
    "type of a constant": ("def target():\n    return VALUE\n", ("1", "1.0")),
    "sign of a zero": ("def target():\n    return VALUE\n", ("0.0", "-0.0")),
    "truth or number": ("X = VALUE\ndef target():\n    return X\n", ("True", "1")),
    "text or bytes": ("X = VALUE\ndef target():\n    return X\n", ("'a'", "b'a'")),
    "list or tuple": ("X = VALUE\ndef target():\n    return X\n", ("[1, 2]", "(1, 2)")),
    "order of a list": ("X = VALUE\ndef target():\n    return X\n", ("[1, 2]", "[2, 1]")),
    "boundary of texts": ("X = VALUE\ndef target():\n    return X\n", ("['a', 'bc']", "['ab', 'c']")),
    "default": ("def target(x=VALUE):\n    return x\n", ONE_TWO),
    "keyword's default": ("def target(*, x=VALUE):\n    return x\n", ONE_TWO),
    "mutable default": ("def target(x=[VALUE]):\n    return x\n", ONE_TWO),
    "generator or list": ("def target(x):\n    VALUE i\n", ("yield", "return")),
    "what an exception does": (
        "def target(x):\n    try:\n        return 1 / x\n    except VALUE:\n        return 0\n",
        ("ValueError", "ZeroDivisionError"),
    ),
    "method": (method("def f(self): return VALUE"), ONE_TWO),
    "property": (method("@property", "def f(self): return VALUE"), ONE_TWO),
    "global that a property reads": (
        method("@property", "def f(self): return X", before="X = VALUE"), ONE_TWO,
    ),
    "setter": (
        method("f = property()", "@f.setter", "def f(self, v): self.v = v + VALUE"), ONE_TWO,
    ),
    "cached property": (
        method("@functools.cached_property", "def f(self): return X",
               before="import functools\nX = VALUE"), ONE_TWO,
    ),
    "static method": (method("@staticmethod", "def f(): return X", before="X = VALUE"), ONE_TWO),
    "class method": (method("@classmethod", "def f(cls): return X", before="X = VALUE"), ONE_TWO),
    "kind of method": (method("@VALUE", "def f(x=0): return 0"), ("staticmethod", "classmethod")),
    "class attribute": (method("x = VALUE"), ONE_TWO),
    "object as class attribute": (
        method("x = Gain(VALUE)", before="class Gain:\n    def __init__(self, v): self.v = v"),
        ONE_TWO,
    ),
    "own descriptor": (
        method("x = D(VALUE)", before="class D:\n    def __init__(self, v): self.v = v\n"
               "    def __get__(self, o, t): return self.v"), ONE_TWO,
    ),
    "code of a descriptor": (
        method("x = D()", before="class D:\n    def __get__(self, o, t): return VALUE"), ONE_TWO,
    ),
    "base class": (
        "class Base:\n    def f(self): return VALUE\nclass target(Base): pass\n", ONE_TWO,
    ),
    "property of a base class's base": (
        "class A:\n    @property\n    def f(self): return X\nX = VALUE\n"
        "class B(A): pass\nclass target(B): pass\n", ONE_TWO,
    ),
    "order of bases": (
        "class A:\n    x = 1\nclass B:\n    x = 2\nclass target(VALUE): pass\n", ("A, B", "B, A"),
    ),
    "metaclass": (
        "class Meta(type):\n    def __call__(cls): return VALUE\n"
        "class target(metaclass=Meta): pass\n", ONE_TWO,
    ),
    "nested class": (method("class Inner:", "    def f(self): return VALUE"), ONE_TWO),
    "slots": (method("__slots__ = ('VALUE',)"), ("a", "b")),
    "wrapped function": (
        "import functools\ndef twice(f):\n    @functools.wraps(f)\n    def g(x): return VALUE * f(x)\n"
        "    return g\n@twice\ndef target(x): return x\n", ONE_TWO,
    ),
    "what is wrapped": (
        "import functools\ndef twice(f):\n    @functools.wraps(f)\n    def g(x): return 2 * f(x)\n"
        "    return g\n@twice\ndef target(x): return x + VALUE\n", ONE_TWO,
    ),
    "partial": (
        "import functools\ndef f(x, y): return x + y\ntarget = functools.partial(f, VALUE)\n",
        ONE_TWO,
    ),
    "partial method": (
        method("def f(self, x): return x", "g = functools.partialmethod(f, VALUE)",
               before="import functools"), ONE_TWO,
    ),
    "memoised function": (
        "import functools\n@functools.lru_cache\ndef target(x): return X\nX = VALUE\n", ONE_TWO,
    ),
    "size of a memo": (
        "import functools\n@functools.lru_cache(VALUE)\ndef target(x): return x\n", ONE_TWO,
    ),
    "single dispatch": (
        "import functools\n@functools.singledispatch\ndef target(x): return 0\n"
        "@target.register\ndef _(x: int): return VALUE\n", ONE_TWO,
    ),
    "context manager": (
        "import contextlib\n@contextlib.contextmanager\ndef target():\n    yield VALUE\n", ONE_TWO,
    ),
    "default of a dataclass": (
        "import dataclasses\n@dataclasses.dataclass\nclass target:\n    x: float = VALUE\n", ONE_TWO,
    ),
    "field of a dataclass": (
        "import dataclasses\n@dataclasses.dataclass\nclass target:\n    VALUE: float = 0\n",
        ("x", "y"),
    ),
    "factory of a dataclass": (
        "import dataclasses\nX = VALUE\n@dataclasses.dataclass\nclass target:\n"
        "    x: list = dataclasses.field(default_factory=lambda: [X])\n", ONE_TWO,
    ),
    "frozen": (
        "import dataclasses\n@dataclasses.dataclass(frozen=VALUE)\nclass target:\n    x: int = 0\n",
        ("True", "False"),
    ),
    "enumeration": ("import enum\nclass target(enum.Enum):\n    A = VALUE\n", ONE_TWO),
    "attribute of a member of an enumeration": (
        "import enum\nclass target(enum.Enum):\n    A = 1\ntarget.A.gain = VALUE\n", ONE_TWO,
    ),
    "order of an enumeration": (
        "import enum\nclass target(enum.Enum):\nVALUE",
        ("    A = 1\n    B = 2\n", "    B = 2\n    A = 1\n"),
    ),
    "class that an abstract class is told of": (
        "import abc\nclass A(abc.ABC): pass\nA.register(VALUE)\n"
        "def target(x): return isinstance(x, A)\n", ("int", "str"),
    ),
    "default of a pydantic model": (
        "import pydantic\nclass C(pydantic.BaseModel):\n    a: float = VALUE\nX = C()\n"
        "def target(): return X.a\n", ONE_TWO,
    ),
    "limit of a pydantic model": (
        "import pydantic\nclass target(pydantic.BaseModel):\n"
        "    a: float = pydantic.Field(1, le=VALUE)\n", ("3", "4"),
    ),
    "limit of a pydantic model by a variable of a function": (
        "import pydantic, typing\ndef made():\n"
        "    Limited = typing.Annotated[float, pydantic.Field(le=VALUE)]\n"
        "    class C(pydantic.BaseModel):\n        a: 'Limited' = 1\n    return C\n"
        "target = made()\n", ("3", "4"),
    ),
    "validator of a pydantic model": (
        "import pydantic\nclass target(pydantic.BaseModel):\n    a: float = 1\n"
        "    @pydantic.field_validator('a')\n    @classmethod\n"
        "    def f(cls, v): return VALUE * v\n", ONE_TWO,
    ),
    "annotation that code reads": (
        "class Base:\n    def __init__(self):\n"
        "        for n in type(self).__annotations__: setattr(self, n, 1)\n"
        "class target(Base):\n    VALUE: int\n", ("a", "b"),
    ),
    "annotation that a wrapper reads": (
        "def units(f):\n    def g(x): return x * f.__annotations__['return']\n    return g\n"
        "@units\ndef target(x) -> VALUE: return x\n", ONE_TWO,
    ),
    "text of a class that code reads": (
        "class target:\n    'VALUE'\n    def f(self): return float(self.__doc__)\n", ONE_TWO,
    ),
    "order of methods that code reads": (
        "class target:\nVALUE\n    def h(self): return [n for n in vars(type(self))]\n",
        ("    def f(self): return 1\n    def g(self): return 2",
         "    def g(self): return 2\n    def f(self): return 1"),
    ),
    "classes that code finds by their base": (
        "class Base: pass\nclass A(Base): x = VALUE\n"
        "def target(): return [c.x for c in Base.__subclasses__()]\n", ONE_TWO,
    ),
    "global that is found by its name": (
        "X = VALUE\ndef target(): return globals()['X']\n", ONE_TWO,
    ),
    "global in the module that is found by its own name": (
        "import sys\nX = VALUE\ndef target(): return getattr(sys.modules[__name__], 'X')\n", ONE_TWO,
    ),
    "global in the module of a function": (
        "import sys\nX = VALUE\ndef target(): return vars(sys.modules[target.__module__])['X']\n",
        ONE_TWO,
    ),
    "global among those of a function": (
        "X = VALUE\ndef target(): return target.__globals__['X']\n", ONE_TWO,
    ),
    "global among those of a frame": (
        "import sys\nX = VALUE\ndef target(): return sys._getframe().f_globals['X']\n", ONE_TWO,
    ),
    "global in a text": ("X = VALUE\ndef target(): return eval('X + 1')\n", ONE_TWO),
    "builtin that is new": (
        "import builtins\nbuiltins.GAIN = VALUE\ndef target(): return GAIN\n", ONE_TWO,
    ),
    "function in place of a builtin": (
        "import builtins\nbuiltins.ascii = lambda x: VALUE\ndef target(x): return ascii(x)\n",
        ONE_TWO,
    ),
    "function in place of a package's": (
        "import statistics\nstatistics.median_low = lambda x: VALUE\n"
        "def target(x): return statistics.median_low(x)\n", ONE_TWO,
    ),
    "method that is put into a package's class": (
        "import tabnanny\ntabnanny.NannyNag.gain = lambda self: VALUE\n"
        "class target(tabnanny.NannyNag): pass\n", ONE_TWO,
    ),
    "bits of a value that is not a number": (
        "import struct\nX = struct.unpack('<d', bytes([VALUE, 0, 0, 0, 0, 0, 0xf8, 0x7f]))[0]\n"
        "def target(): return struct.pack('<d', X)\n", ONE_TWO,
    ),
    "object that says it is a name": (
        "class A:\n    def __init__(self, v): self.v = v\n    def __reduce__(self): return 'X'\n"
        "X = A(VALUE)\ndef target(): return X.v\n", ONE_TWO,
    ),
    "digits of a long double": (
        "import numpy as np\nX = np.longdouble(1) + np.longdouble(VALUE) * 2.0 ** -62\n"
        "X = X, np.array([X])\ndef target(): return X\n", ONE_TWO,
    ),
    "leaf of many tuples": (
        "X = (VALUE,)\nfor _ in range(200): X = (X, X)\ndef target(): return X\n", ONE_TWO,
    ),
    "named tuple": (
        "from typing import NamedTuple\nclass target(NamedTuple):\n    x: int = VALUE\n", ONE_TWO,
    ),
    "closure": (
        "def of(x):\n    def f(): return x\n    return f\ntarget = of(VALUE)\n", ONE_TWO,
    ),
    "closure over an object": (
        "class Gain:\n    def __init__(self, v): self.v = v\n"
        "def of(x):\n    def f(): return x.v\n    return f\ntarget = of(Gain(VALUE))\n", ONE_TWO,
    ),
    "closure over a lambda": (
        "def of(g):\n    def f(): return g()\n    return f\ntarget = of(lambda: VALUE)\n", ONE_TWO,
    ),
    "global of a global function": (
        "X = VALUE\ndef g(): return X\ndef f(): return g()\ndef target(): return f()\n", ONE_TWO,
    ),
    "global in a comprehension": (
        "X = VALUE\ndef target(n): return [X for _ in range(n)]\n", ONE_TWO,
    ),
    "global in a lambda in a function": (
        "X = VALUE\ndef target(): return lambda: (lambda: X)\n", ONE_TWO,
    ),
    "global in a class in a function": (
        "X = VALUE\ndef target():\n    class C:\n        x = X\n    return C\n", ONE_TWO,
    ),
    "bound method": (
        "class A:\n    def __init__(self, v): self.v = v\n    def f(self): return self.v\n"
        "target = A(VALUE).f\n", ONE_TWO,
    ),
    "object with slots": (
        "class A:\n    __slots__ = ('v',)\n    def __init__(self, v): self.v = v\n"
        "X = A(VALUE)\ndef target(): return X.v\n", ONE_TWO,
    ),
    "class of an object": (
        "class A: pass\nclass B: pass\nX = VALUE()\ndef target(): return X\n", ("A", "B"),
    ),
    "method of an object's class": (
        "class A:\n    def f(self): return VALUE\nX = A()\ndef target(): return X.f()\n", ONE_TWO,
    ),
    "object deep in containers": (
        "class A:\n    def __init__(self, v): self.v = v\n"
        "X = {'a': [(A(VALUE),)]}\ndef target(): return X\n", ONE_TWO,
    ),
    "array": ("import numpy as np\nX = np.arange(4) * VALUE\ndef target(): return X\n", ONE_TWO),
    "type of an array": (
        "import numpy as np\nX = np.zeros(4, VALUE)\ndef target(): return X\n",
        ("np.float32", "np.int32"),
    ),
    "shape of an array": (
        "import numpy as np\nX = np.zeros(VALUE)\ndef target(): return X\n", ("(2, 3)", "(3, 2)"),
    ),
    "middle of a large array": (
        "import numpy as np\nX = np.zeros(9000)\nX[4500] = VALUE\ndef target(): return X\n", ONE_TWO,
    ),
    "array of objects": (
        "import numpy as np\nX = np.array([{'a': VALUE}], object)\ndef target(): return X\n",
        ONE_TWO,
    ),
    "mask of an array": (
        "import numpy as np\nX = np.ma.array([1, 2], mask=VALUE)\ndef target(): return X\n",
        ("[0, 1]", "[1, 0]"),
    ),
    "random state": (
        "import numpy as np\nX = np.random.default_rng(VALUE)\ndef target(): return X.random()\n",
        ONE_TWO,
    ),
    "member of a set": ("X = {'a', VALUE}\ndef target(): return X\n", ("'b'", "'c'")),
    "value of a dict": ("X = {'a': VALUE}\ndef target(): return X\n", ONE_TWO),
    "order of a dict": (
        "def f(x): return x + 1\ndef g(x): return x * 2\nX = VALUE\n"
        "def target(x):\n    for s in X.values(): x = s(x)\n    return x\n",
        ("{'f': f, 'g': g}", "{'g': g, 'f': f}"),
    ),
    "order of a dict with equal keys": (
        "class K: pass\nX = {K(): v for v in VALUE}\ndef target(): return X\n", ("[1, 2]", "[2, 1]"),
    ),
    "order of an ordered dict": (
        "from collections import OrderedDict\nX = OrderedDict(VALUE)\ndef target(): return X\n",
        ("a=1, b=2", "b=2, a=1"),
    ),
    "decimal": (
        "from decimal import Decimal\nX = Decimal('VALUE')\ndef target(): return X\n", ONE_TWO,
    ),
    "function of a package": (
        "import math\nX = VALUE\ndef target(x): return X(x)\n", ("math.sin", "math.cos"),
    ),
    "attribute of a package": ("import math\ndef target(x): return math.VALUE(x)\n", ("sin", "cos")),
    "cycle of objects": (
        "class A: pass\nX = A()\nX.me = X\nX.v = VALUE\ndef target(): return X\n", ONE_TWO,
    ),
    "cycle of functions": (
        "def f(n): return target(n - 1)\ndef target(n): return f(n) + VALUE\n", ONE_TWO,
    ),
    "where a cycle leads": (
        "a, b = [1], [1]\na.append(a)\nb.append(a)\nX = VALUE\ndef target(): return X\n", ("a", "b"),
    ),
    "imported function": (
        {"m": "from helper import f\ndef target(): return f()\n",
         "helper": "X = VALUE\ndef f(): return X\n"}, ONE_TWO,
    ),
    "attribute of a module": (
        {"m": "import helper\ndef target(): return helper.X\n", "helper": "X = VALUE\n"}, ONE_TWO,
    ),
    "what a module imports": (
        {"m": "import helper\ndef target(): return helper.f()\n",
         "helper": "import deeper\ndef f(): return deeper.X\n", "deeper": "X = VALUE\n"}, ONE_TWO,
    ),
    "attribute set from outside": (
        {"m": "import helper\nhelper.X = VALUE\ndef target(): return helper.X\n",
         "helper": "X = 0\n"}, ONE_TWO,
    ),
    "attribute of a module in a module set from outside": (
        {"m": "import helper\nhelper.deeper.X = VALUE\ndef target(): return helper.deeper.X\n",
         "helper": "import deeper\n", "deeper": "X = 0\n"}, ONE_TWO,
    ),
    "import in a function": (
        {"m": "def target():\n    import helper\n    return helper.X\n", "helper": "X = VALUE\n"},
        ONE_TWO,
    ),
    "import from in a function, set from outside": (
        {"m": "import helper\nhelper.X = VALUE\ndef target():\n    from helper import X\n    return X\n",
         "helper": "X = 0\n"}, ONE_TWO,
    ),
    "import in a function, set from outside": (
        {"m": "import helper\nhelper.X = VALUE\ndef target():\n    import helper as h\n    return h.X\n",
         "helper": "X = 0\n"}, ONE_TWO,
    ),
    "module as an argument": (
        {"m": "import helper\nhelper.X = VALUE\ndef target(m=helper): return m.X\n",
         "helper": "X = 0\n"}, ONE_TWO,
    ),
    "value of a module that is handed on": (
        {"m": "import helper\nhelper.X = VALUE\ndef f(m): return m.X\n"
              "def target(): return f(helper)\n", "helper": "X = 0\n"}, ONE_TWO,
    ),
    "value among those of a module": (
        {"m": "import helper\nhelper.X = VALUE\ndef target(): return helper.__dict__['X']\n",
         "helper": "X = 0\n"}, ONE_TWO,
    ),
    "module in a closure": (
        {"m": "def of():\n    import helper\n    helper.X = VALUE\n    def f(): return helper.X\n"
              "    return f\ntarget = of()\n", "helper": "X = 0\n"}, ONE_TWO,
    ),
    "attribute of a module that is found by its name": (
        {"m": "import sys, helper\nhelper.X = VALUE\ndef target(): return sys.modules['helper'].X\n",
         "helper": "X = 0\n"}, ONE_TWO,
    ),
    "module that is imported by its name": (
        {"m": "import importlib\ndef target(): return importlib.import_module('helper').X\n",
         "helper": "X = VALUE\n"}, ONE_TWO,
    ),
    "module without a file that is imported in a function": (
        "import sys, types\nsys.modules['helper'] = types.ModuleType('helper')\n"
        "sys.modules['helper'].X = VALUE\n"
        "def target():\n    import helper\n    return helper.X\n", ONE_TWO,
    ),
    "part of a package that is imported in a function": (
        {"m": "def target():\n    from helper import deeper\n    return deeper.X\n",
         "helper/__init__": "", "helper/deeper": "X = VALUE\n"}, ONE_TWO,
    ),
    "attribute of a function": ("def target(): pass\ntarget.x = VALUE\n", ONE_TWO),
}  # fmt: skip

UNCHANGED: dict[str, str] = {
    "nothing": "def target():\n    return 1\n",
    "set in code": "def target(x):\n    return x in {'a', 'b', 'c', 'd'}\n",
    "set of texts": "X = {f'{i}' for i in range(50)}\ndef target(): return X\n",
    "frozen set in a class": method("x = frozenset('abcdefgh')"),
    "sets in sets": (
        "X = {frozenset({f'{i}', f'{j}'}) for i in range(5) for j in range(5)}\n"
        "def target(): return X\n"
    ),
    "set of objects": (
        "class A:\n    def __init__(self, v): self.v = v\n"
        "X = {A(i) for i in range(9)}\ndef target(): return X\n"
    ),
    "set in a cycle": (
        "class A: pass\nX = {A(), A(), A()}\nfor n, a in enumerate(sorted(X, key=id)):\n"
        "    a.all = X\ndef target(): return X\n"
    ),
    "dict made of a sorted set": (
        "X = {k: 1 for k in sorted(set('gfedcba'))}\ndef target(): return X\n"
    ),
    "dict with keys that are equal": (
        "class K: pass\nX = {K(): i for i in range(9)}\ndef target(): return X\n"
    ),
    "pydantic model": (
        "import pydantic\nclass C(pydantic.BaseModel):\n    a: float = 1\n    b: int = 2\n"
        "class target:\n    c = C()\n"
    ),
    "pydantic model beside variables of a function": (
        "import pydantic, threading, uuid\nX = []\ndef made():\n    lock = threading.Lock()\n"
        "    name, file = str(uuid.uuid4()), __file__\n    X.append(lock)\n"
        "    class C(pydantic.BaseModel):\n        a: float = 1\n    return C\ntarget = made()\n"
    ),
    "pydantic model of code that is run": (  # by `exec`; pydantic before 2.9 keeps its globals
        "X = {}\nexec('import pydantic, threading\\nlock = threading.Lock()\\n'\n"
        "     'class target(pydantic.BaseModel):\\n    a: float = 1', X)\ntarget = X['target']\n"
    ),
    "pydantic dataclass": (
        "import pydantic.dataclasses\n@pydantic.dataclasses.dataclass\nclass C:\n"
        "    a: float = 1\nX = C()\ndef target(): return X.a\n"
    ),
    "tuples in tuples, many times": (
        "X = (1.0,)\nfor _ in range(200): X = (X, X)\ndef target(): return X\n"
    ),
    "sets in sets, many times": (
        "X = frozenset({1})\nfor n in range(100): X = frozenset({(X, 'a'), (X, 'b')})\n"
        "def target(): return X\n"
    ),
    **{
        f"path beside the file, {where}": (
            "import dataclasses, functools, os\nfrom pathlib import Path\n"
            "P = Path(__file__).parent / 'data'\n" + source
        )
        for where, source in {
            "in a class": "class target:\n    a = P\n    b = [str(P)]\n",
            "in a dataclass": "@dataclasses.dataclass\nclass target:\n    a: str = str(P)\n",
            "in a partial": "def f(p): return p\ntarget = functools.partial(f, str(P))\n",
            "in an object": "class A:\n    def __init__(self): self.p = str(P)\n"
                            "    def f(self): return self.p\ntarget = A().f\n",
        }.items()
    },
    "object without a text": "X = object()\ndef target(): return X\n",
    "default of a dataclass with an address": (
        "import dataclasses\nX = object()\n@dataclasses.dataclass\nclass target:\n"
        "    x: object = X\n"
    ),
    "file's own place": "def target():\n    return __file__\n",
    "path beside the file": (
        "from pathlib import Path\nX = Path(__file__).parent / 'data'\ndef target(): return X\n"
    ),
    "text of a path beside the file": (
        "import os\nX = os.path.join(os.path.dirname(__file__), 'data')\ndef target(): return X\n"
    ),
    "enumeration": "import enum\nclass target(enum.Flag):\n    A = 1\n    B = 2\n",
    "protocol": (
        "from typing import Protocol, Generic, TypeVar\nT = TypeVar('T')\n"
        "class P(Protocol[T]):\n    x: int\n    def f(self) -> T: ...\n"
        "class target(P[int]):\n    y: 'int | None' = None\n"
    ),
    "pattern": "import re\nX = re.compile('a+', re.I)\ndef target(x): return X.match(x)\n",
    "logger": "import logging\nX = logging.getLogger('a')\ndef target(): X.info('')\n",
    "environment": "from os import environ\ndef target(): return environ.get('A')\n",
    "table": (
        "import pandas as pd\nX = pd.DataFrame({'a': [1, 2], 'b': ['x', 'y']})\n"
        "def target(): return X\n"
    ),
    "interpolation": (
        "import numpy as np\nfrom scipy.interpolate import CubicSpline\n"
        "X = CubicSpline(np.arange(5), np.arange(5.) ** 2)\ndef target(t): return X(t)\n"
    ),
    "universal function": (
        "import numpy as np\nX = [np.sin, np.float64(2), np.dtype('f4')]\ndef target(): return X\n"
    ),
    "receiver": (
        "import sblcosim\nclass target(sblcosim.Receiver):\n    def update(self, samples):\n"
        "        return sblcosim.Estimate(samples[-1].epoch, (0.0, 0.0, 0.0))\n"
    ),
    "cycle of objects": (
        "class A: pass\nX, Y = A(), A()\nX.other, Y.other = Y, X\ndef target(): return X\n"
    ),
    "many functions that call each other": (
        "".join(f"def f{i}(n): return " + " + ".join(f"f{j}(n)" for j in range(30)) + "\n"
                for i in range(30)) + "target = f0\n"
    ),
}  # fmt: skip
"""Modules without a VALUE, which nothing but processes and folders could tell apart."""

SAME: dict[str, tuple[str | Files, tuple[str, str]]] = {
    **{name: (source, ("", "")) for name, source in UNCHANGED.items()},
    "comment": ("def target():\n    VALUE\n    return 1\n", ("# one", "# two")),
    "blank lines": ("VALUE\ndef target():\n    return 1\n", ("", "\n\n\n")),
    "another global": ("X = VALUE\ndef target():\n    return 1\n", ONE_TWO),
    "a global with the name of an attribute": (
        "real = VALUE\ndef target(x):\n    return x.real\n", ONE_TWO,
    ),
    "another function": ("def f(): return VALUE\ndef target():\n    return 1\n", ONE_TWO),
    "order of functions": (
        "VALUE\ndef target(): return f() + g()\n",
        ("def f(): return 1\ndef g(): return 2", "def g(): return 2\ndef f(): return 1"),
    ),
    "order of methods": (
        "class target:\nVALUE\n",
        ("    def f(self): return 1\n    def g(self): return 2",
         "    def g(self): return 2\n    def f(self): return 1"),
    ),
    "order of a set's own attributes": (
        "class A(frozenset): pass\nX = A([1])\nVALUE\ndef target(): return X\n",
        ("X.a = 1; X.b = 2", "X.b = 2; X.a = 1"),
    ),
    "order in which a generic function got its cases": (
        "import functools\n@functools.singledispatch\ndef target(x): return 0\nVALUE\n",
        ("@target.register\ndef f(x: int): return 1\n@target.register\ndef g(x: str): return 2",
         "@target.register\ndef g(x: str): return 2\n@target.register\ndef f(x: int): return 1"),
    ),
    "package's function that holds the generator of all": (
        "from scipy.stats import norm\nfrom scipy import stats\nX = stats.uniform(0, 1)\nVALUE\n"
        "def target(): return norm.ppf(.9) + X.ppf(.1)\n", ("", "norm.rvs()"),
    ),
    "methods of the generators of all": (
        "import numpy as np\nfrom random import gauss\nfrom numpy.random import normal\nVALUE\n"
        "def target(): return gauss(0, 1) + normal()\n", ("", "gauss(0, 1), normal()"),
    ),
    "long doubles": (
        "import numpy as np\nA = np.array([1.1, 2.2, 3.3, 4.4], np.longdouble)\n"
        "if np.finfo(A.dtype).nmant == 63:\n"
        "    A.view(np.uint8).reshape(4, -1)[:, 10:] = VALUE\n"
        "X = A, A[0], A.view(np.clongdouble), A.view(np.clongdouble)[0]\n"
        "def target(): return X\n", ONE_TWO,
    ),
    "bytes between the fields of a record": (
        "import numpy as np\nX = np.zeros(2, np.dtype([('a', 'i1'), ('b', 'f8')], align=True))\n"
        "X.view(np.uint8).reshape(2, -1)[:, 1:8] = VALUE\nX = X[0], X.copy(), X\n"
        "def target(): return X\n", ONE_TWO,
    ),
    "equal texts, shared or not": (
        "a = 'x' * 9\nX = [a, VALUE]\ndef target(): return X\n", ("a", "''.join('x' * 9)"),
    ),
    "use of a memo": (
        "import functools\n@functools.lru_cache\ndef target(x): return x\nVALUE\n",
        ("target(1)", "target(2), target(3)"),
    ),
    "layout of an array": (
        "import numpy as np\nX = np.array([[1., 2.], [3., 4.]], order='VALUE')\n"
        "def target(): return X\n", ("C", "F"),
    ),
    "abstract class": (
        "import abc\nclass target(abc.ABC):\n    @abc.abstractmethod\n    def f(self): ...\nVALUE\n",
        ("", "isinstance(1, target)"),
    ),
    "annotation": ("def target(x: VALUE = 0):\n    return x\n", ("int", "float")),
    "other modules": (
        {"m": "VALUE\ndef target(): return 1\n", "helper": "X = 1\n"}, ("", "import helper"),
    ),
    "another value of a module": (
        {"m": "import helper\nhelper.Y = VALUE\ndef target(): return helper.X\n",
         "helper": "X = 1\nY = 0\n"}, ONE_TWO,
    ),
    "another function of a module": (
        {"m": "from helper import f\ndef target(): return f()\n",
         "helper": "def f(): return 1\ndef g(): return VALUE\n"}, ONE_TWO,
    ),
}  # fmt: skip

REFUSED: dict[str, tuple[str, str]] = {
    "lock": ("import threading\nLOCK = threading.Lock()\ndef target():\n    with LOCK: pass\n",
             "lock at target > LOCK"),
    "open file": ("FILE = open(__file__)\ndef target(): return FILE.read()\n", "at target > FILE"),
    "generator": ("X = (i for i in range(3))\ndef target(): return next(X)\n", "generator at"),
    "function of a package that is made of the user's": (
        "import numpy as np\nX = np.frompyfunc(lambda a: a + 1, 1, 1)\ndef target(a): return X(a)\n",
        "ufunc, which no module has as"),
    "iterator": ("import itertools\nX = itertools.count()\ndef target(): return next(X)\n", "count at"),
    "library": ("import ctypes\nX = ctypes.CDLL(None)\ndef target(): return X\n", "CDLL at"),
    "pointer": ("import ctypes\nX = ctypes.pointer(ctypes.c_int(1))\ndef target(): return X\n",
                "at target > X"),
    "weak reference": ("import weakref\nclass A: pass\na = A()\nX = weakref.ref(a)\n"
                       "def target(): return X()\n", "at target > X"),
    "connection": ("import sqlite3\nX = sqlite3.connect(':memory:')\ndef target(): return X\n",
                   "Connection at"),
    "thread": ("import threading\nX = threading.Thread()\ndef target(): return X\n",
               "at target > X > <Thread>"),
    "lock in an object in a class": (
        "import threading\nclass A:\n    def __init__(self): self.lock = threading.Lock()\n"
        "class target:\n    x = [A()]\n", "lock at target > x > [0] > <A> > lock"),
    "deep nesting": ("X = []\nfor _ in range(100_000): X = [X]\ndef target(): return X\n",
                     "nested too deeply"),
}  # fmt: skip

IMPORTS: dict[str, tuple[Files, tuple[str, str]]] = {
    "the file": ({"m": "def target(): return VALUE\n"}, ONE_TWO),
    "import": (
        {"m": "import helper\ndef target(): return helper.X\n", "helper": "X = VALUE\n"}, ONE_TWO,
    ),
    "import from": (
        {"m": "from helper import X\ndef target(): return X\n", "helper": "X = VALUE\n"}, ONE_TWO,
    ),
    "import of an import": (
        {"m": "import helper\ndef target(): return helper.X\n", "helper": "from deeper import X\n",
         "deeper": "X = VALUE\n"}, ONE_TWO,
    ),
    "import in a function": (
        {"m": "def target():\n    import helper\n    return helper.X\n", "helper": "X = VALUE\n"},
        ONE_TWO,
    ),
    "import at run time": (
        {"m": "import importlib\nX = importlib.import_module('hel' + 'per').X\n"
              "def target(): return X\n", "helper": "X = VALUE\n"}, ONE_TWO,
    ),
    "module loaded from a file": (
        {"m": "import importlib.util as u\nfrom pathlib import Path\n"
              "s = u.spec_from_file_location('other', Path(__file__).parent / 'helper.py')\n"
              "other = u.module_from_spec(s)\ns.loader.exec_module(other)\n"
              "def target(): return other.X\n", "helper": "X = VALUE\n"}, ONE_TWO,
    ),
    "value of a module loaded from a file": (
        {"m": "import importlib.util as u\nfrom pathlib import Path\ndef load(n):\n"
              "    s = u.spec_from_file_location(n, Path(__file__).parent / f'{n}.py')\n"
              "    m = u.module_from_spec(s)\n    s.loader.exec_module(m)\n    return m.X\n"
              "X = load('helper')\ndef target(): return X\n", "helper": "X = VALUE\n"}, ONE_TWO,
    ),
    "file that is run": (
        {"m": "import runpy\nfrom pathlib import Path\n"
              "X = runpy.run_path(str(Path(__file__).parent / 'helper.py'))['X']\n"
              "def target(): return X\n", "helper": "X = VALUE\n"}, ONE_TWO,
    ),
    "file that is read and run": (
        {"m": "from pathlib import Path\nexec((Path(__file__).parent / 'helper.py').read_text())\n"
              "def target(): return X\n", "helper": "X = VALUE\n"}, ONE_TWO,
    ),
    "what a file that is run imports": (
        {"m": "import runpy\nfrom pathlib import Path\n"
              "X = runpy.run_path(str(Path(__file__).parent / 'helper.py'))['f']\n"
              "def target(): return X()\n",
         "helper": "def f():\n    import deeper\n    return deeper.X\n", "deeper": "X = VALUE\n"},
        ONE_TWO,
    ),
    "import by its name in a function": (
        {"m": "import importlib\ndef target(): return importlib.import_module('helper').X\n",
         "helper": "X = VALUE\n"}, ONE_TWO,
    ),
    "package": (
        {"m": "from helper.deeper import X\ndef target(): return X\n", "helper/__init__": "",
         "helper/deeper": "from .far import X\n", "helper/far": "X = VALUE\n"}, ONE_TWO,
    ),
    "package's own code": (
        {"m": "from helper.deeper import X\ndef target(): return X\n",
         "helper/__init__": "Y = VALUE\n", "helper/deeper": "X = 1\n"}, ONE_TWO,
    ),
    "part of a package": (
        {"m": "from helper import deeper\ndef target(): return deeper.X\n", "helper/__init__": "",
         "helper/deeper": "X = VALUE\n"}, ONE_TWO,
    ),
    "package above": (
        {"m": "import helper.deeper\ndef target(): return helper.deeper.X\n", "helper/__init__": "",
         "helper/deeper": "from . import far\nX = far.X\n",
         "helper/far": "X = VALUE\n"}, ONE_TWO,
    ),
    "circle of imports": (
        {"m": "import helper\ndef target(): return 1\n", "helper": "import deeper\nX = 1\n",
         "deeper": "import helper\nX = VALUE\n"}, ONE_TWO,
    ),
    "import that may be missing": (
        {"m": "try:\n    from helper import X\nexcept ImportError:\n    X = 0\n"
              "def target(): return X\n", "VALUE": "X = 1\n"}, ("helper", "other"),
    ),
    "package and its version": (
        {"m": "import VALUE\ndef target(): return 1\n"}, ("numpy", "scipy"),
    ),
}  # fmt: skip

OTHER_FILES: dict[str, tuple[Files, tuple[str, str]]] = {
    "file that is not imported": (
        {"m": "def target(): return 1\n", "helper": "X = VALUE\n"}, ONE_TWO,
    ),
    "file whose name is handed to another function": (
        {"m": "def target(): return len('helper')\n", "helper": "X = VALUE\n"}, ONE_TWO,
    ),
    "number that is handed to a function of the same name": (
        {"m": "def import_module(n): return n\ndef target(): return import_module(VALUE)\n"},
        ("1", "1"),
    ),
    "another function's module is there or not": (
        {"m": "import helper\ndef target(): return helper.X\n", "helper": "X = 1\n",
         "deeper": "X = VALUE\n"}, ONE_TWO,
    ),
    "a package": ({"m": "import numpy as np\ndef target(): return np.pi\n"}, ("", "")),
    "sets": ({"m": "X = {'a', 'b', 'c'}\ndef target(x): return x in X\n"}, ("", "")),
    "what cannot be made canonical": (
        {"m": "import threading\nL = threading.Lock()\ndef target(): return L\n"}, ("", ""),
    ),
}  # fmt: skip

USED: dict[str, tuple[str | Files, tuple[str, str]]] = {
    "import": ("def target():\n    import colorsys\n    return colorsys.rgb_to_hsv(1, 2, 3)\n", ("", "")),
    "import from": ("def target():\n    from wave import Error\n    return Error\n", ("", "")),
    "part of a package": (
        "def target():\n    from xml import sax\n    import xml.dom.minidom as q\n"
        "    import xml.etree.ElementTree\n    return sax, q.parse, xml.etree.ElementTree.parse\n",
        ("", ""),
    ),
    "installed package": (
        "def target():\n    from scipy.optimize import least_squares\n    return least_squares\n",
        ("", ""),
    ),
    "helper": (
        {"m": "def target():\n    import helper\n    return helper.X\n", "helper": "X = [1]\n"}, ("", ""),
    ),
    "part of a helper": (
        {"m": "def target():\n    from helper import deeper, Y\n    import helper.far\n"
              "    return deeper.X, helper.far.X\n", "helper/__init__": "Y = 1\n",
         "helper/deeper": "X = 1\n", "helper/far": "from xml import dom as X\n"}, ("", ""),
    ),
    "import of an import": (
        {"m": "def target():\n    from helper import f\n    return f()\n",
         "helper": "def f():\n    import deeper\n    return deeper.X\n", "deeper": "X = 1\n"}, ("", ""),
    ),
    "import that fails": (
        {"m": "def target():\n    try:\n        import helper\n        return helper.X\n"
              "    except Exception:\n        return 0\n", "helper": "1 / 0\n"}, ("", ""),
    ),
    "import that is missing": (
        "def target():\n    try:\n        import helper\n        return helper.X\n"
        "    except ImportError:\n        return 0\n", ("", ""),
    ),
}  # fmt: skip
"""Functions that load what they need when they are called."""
