"""A package as a picture: components and systems as boxes, connections from left to right (SVG).

The elements of a system are in columns, each to the right of all elements that it gets values
from (the longest path). Connections that lead back run below. In a column, elements are sorted
by the mean position of those to which they are connected. The colour of a connection is that of
the element that gives the values. Colours follow the reader's choice of light or dark.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from statistics import fmean
from xml.sax.saxutils import escape

from sblcosim.fmus.files import write_file

from ..errors import ConfigurationError
from ..simulation.plans.plan import Plan
from ..style import THEMES
from .drawing import Line, about, intervals, lines_of
from .read import Package
from .structure import Path as Inner

_ROW, _HEAD, _PAD, _CHAR = 17.0, 40.0, 12.0, 6.2
_BETWEEN, _ABOVE, _LANE = 64.0, 22.0, 9.0
_LONGEST = 36
_SWEEPS = 6


@dataclass(eq=False)
class _Box:
    """An element of a system, or the place where a connection passes a column (no title)."""

    title: str = ""
    note: str = ""
    ins: dict[str, str] = field(default_factory=dict)
    outs: dict[str, str] = field(default_factory=dict)
    inside: _Inside | None = None
    x: float = 0.0
    y: float = 0.0
    width: float = 0.0
    height: float = 0.0

    def measure(self) -> None:
        """Set the size from the texts and the contents."""
        left, right = (_wide(names.values()) for names in (self.ins, self.outs))
        rows = max(len(self.ins), len(self.outs)) * _ROW
        head = _wide([self.title]) * 1.15, _wide([self.note])
        self.width = max(*head, left + right + 2 * _PAD) + 2 * _PAD
        self.height = _HEAD + rows + _PAD
        if self.inside is not None:
            self.inside.left = left + 2 * _PAD
            width = self.inside.left + self.inside.width + right + 2 * _PAD
            self.width = max(self.width, width)
            self.height = max(self.height, _HEAD + self.inside.height + _PAD)

    def port(self, name: str, *, out: bool, within: bool = False) -> tuple[float, float]:
        """Position of a connector, in the coordinates of the surrounding or the inner system."""
        names = self.outs if out else self.ins
        y = _HEAD + ([*names].index(name) + 0.5) * _ROW if self.title else self.height / 2
        x = self.width if out else 0.0
        return (x, y) if within else (self.x + x, self.y + y)


@dataclass(eq=False)
class _Inside:
    """The elements of a system in columns, and its connections."""

    columns: list[list[_Box]] = field(default_factory=list)
    forward: list[tuple[list[_Box | None], Line]] = field(default_factory=list)
    back: list[tuple[_Box, _Box, Line]] = field(default_factory=list)
    colours: Mapping[Inner, int] = field(default_factory=dict)
    left: float = 0.0
    width: float = 0.0
    height: float = 0.0


def save(file: Path, package: Package, plan: Plan) -> None:
    """Write the picture; an existing file is replaced.

    Raises
    ------
    ConfigurationError
        The file cannot be written, or its name is not that of an SVG file.
    """
    if file.suffix.lower() != ".svg":
        raise ConfigurationError(f"{file}: must be an SVG file, FILE.svg, got {file.name}")
    try:
        write_file(file, svg(package, plan).encode())
    except OSError as error:
        raise ConfigurationError(f"{file}: must be writable, got {error.strerror}") from None


def svg(package: Package, plan: Plan) -> str:
    """The picture, as the text of an SVG file.

    Its size in px is that of the system. Texts of more than 36 letters are cut, and viewers show
    them in full under the pointer. The lines below explain colours, dashes and dots.
    """
    lines: dict[Inner, list[Line]] = {}
    for line in lines_of(package):
        lines.setdefault(line.system, []).append(line)
    colours = {path: i for i, path in enumerate(p for p, _ in package.structure.system.walk())}
    notes = {path: about(component) for path, component in intervals(package, plan).items()}
    boxes = {
        path: _Box(title=path[-1] if path else package.name, note=notes.get(path, ""))
        for path, _ in package.structure.system.walk()
    }  # fmt: skip
    for (path, name), out, unit in _connectors(lines.values()):
        boxes[path].outs.setdefault(name, "") if out else boxes[path].ins.setdefault(name, "")
        names = boxes[path].outs if out else boxes[path].ins
        names[name] = f"{name} [{unit}]" if unit else name
    for path in sorted(boxes, key=len, reverse=True):
        if path not in notes:
            inner = {other: box for other, box in boxes.items() if other[:-1] == path != other}
            boxes[path].inside = _arranged(path, inner, lines.get(path, []), colours)
        boxes[path].measure()
    root = boxes[()]
    root.x = root.y = 8.0
    legend = _legend(boxes, [line for own in lines.values() for line in own])
    width = max(root.width, _wide(legend)) + 16
    height = root.height + 16 + _ROW * len(legend)
    size = f'width="{width:.0f}" height="{height:.0f}"'
    return "\n".join([
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} viewBox="0 0 {width:.0f} {height:.0f}" '
        'role="img">', f"<title>{escape(package.name)}</title>", _style(), *_drawn(root),
        *(f'<text class="note" x="8" y="{root.height + 8 + _ROW * i:.1f}">{words}</text>'
          for i, words in enumerate(legend, 1)),
        "</svg>\n",
    ])  # fmt: skip


def _legend(boxes: Mapping[Inner, _Box], lines: Sequence[Line]) -> list[str]:
    """Explanations of what the picture contains."""
    changed = any(line.what for line in lines)
    systems = any(path and box.inside is not None for path, box in boxes.items())
    return [
        *(["Colour: that of the element that gives the value"] if lines else []),
        *(["Dashed: values are changed, or units differ"] if changed else []),
        *(["Dotted frame: a system"] if systems else []),
    ]


def _connectors(
    lines: Iterable[Sequence[Line]],
) -> Iterator[tuple[tuple[Inner, str], bool, str]]:
    """The connectors in use, whether they are on the right side, and their units."""
    for line in (line for own in lines for line in own):
        yield line.source, line.source[0] != line.system, line.units[0]
        yield line.target, line.target[0] == line.system, line.units[1]


# --- Columns --------------------------------------------------------------------------------------


def _arranged(
    path: Inner, boxes: Mapping[Inner, _Box], lines: Sequence[Line], colours: Mapping[Inner, int]
) -> _Inside:
    """The elements of a system in columns."""
    inside = _Inside(colours=colours)
    follow: dict[Inner, list[Inner]] = {other: [] for other in boxes}
    for line in lines:
        if line.source[0] in boxes and line.target[0] in boxes:
            follow[line.source[0]].append(line.target[0])
    columns = _longest(follow)
    inside.columns = [[] for _ in range(max(columns.values(), default=-1) + 1)]
    for other, column in columns.items():
        inside.columns[column].append(boxes[other])
    passing: dict[object, list[_Box]] = {}
    for line in lines:
        source, target = (boxes.get(end[0]) for end in (line.source, line.target))
        first = -1 if source is None else columns[line.source[0]]
        last = len(inside.columns) if target is None else columns[line.target[0]]
        if source is not None and target is not None and first >= last:
            inside.back.append((source, target, line))
            continue
        key = (line.source, line.target[0])  # parallel connections share their way
        between = passing.setdefault(key, [_Box() for _ in range(first + 1, last)])
        for column, box in enumerate(between, first + 1):
            if box not in inside.columns[column]:
                inside.columns[column].append(box)
        inside.forward.append(([source, *between, target], line))
    _order(inside)
    _place(inside)
    return inside


def _longest(follow: Mapping[Inner, Sequence[Inner]]) -> dict[Inner, int]:
    """Columns: the longest path to each, without the connections that close a circle."""
    order: list[Inner] = []
    open_: set[Inner] = set()
    seen: set[Inner] = set()
    fed = {other for others in follow.values() for other in others}
    kept: dict[Inner, list[Inner]] = {path: [] for path in follow}
    for start in sorted(follow, key=lambda path: path in fed):
        stack = [(start, iter(follow[start]))] if start not in seen else []
        seen.add(start)
        open_.add(start)
        while stack:
            path, rest = stack[-1]
            for other in rest:
                if other not in open_:
                    kept[path].append(other)
                if other not in seen:
                    seen.add(other)
                    open_.add(other)
                    stack.append((other, iter(follow[other])))
                    break
            else:
                stack.pop()
                open_.discard(path)
                order.append(path)
        open_.discard(start)
    columns = dict.fromkeys(follow, 0)
    for path in reversed(order):
        for other in kept[path]:
            columns[other] = max(columns[other], columns[path] + 1)
    return columns


def _order(inside: _Inside) -> None:
    """Sort the columns by the mean position of each box's neighbours, back and forth."""
    sides: tuple[dict[int, list[_Box]], dict[int, list[_Box]]] = ({}, {})
    for way, _ in inside.forward:
        for one, other in pairwise(way):
            if one is not None and other is not None:
                sides[0].setdefault(id(other), []).append(one)
                sides[1].setdefault(id(one), []).append(other)
    for sweep in range(_SWEEPS):
        near = sides[sweep % 2]
        places = {id(box): i / len(column) for column in inside.columns
                  for i, box in enumerate(column)}  # fmt: skip
        for column in inside.columns[:: 1 if sweep % 2 == 0 else -1]:
            column.sort(key=lambda box: fmean(
                [places[id(o)] for o in near.get(id(box), ())] or [places[id(box)]]))  # fmt: skip
            places |= {id(box): i / len(column) for i, box in enumerate(column)}


def _place(inside: _Inside) -> None:
    x = 0.0
    heights = [
        sum(box.height + _ABOVE for box in column) - _ABOVE for column in inside.columns
    ]
    inside.height = max(heights, default=0.0)
    for column, height in zip(inside.columns, heights, strict=True):
        wide = max(box.width for box in column)
        x += _BETWEEN
        y = (inside.height - height) / 2
        for box in column:
            box.x, box.y = x, y
            box.width = box.width if box.title else wide
            y += box.height + _ABOVE
        x += wide
    inside.width = x + _BETWEEN
    inside.height += _LANE * (len(inside.back) + 2) if inside.back else 0.0


# --- Drawing --------------------------------------------------------------------------------------


def _drawn(box: _Box) -> Iterator[str]:
    kind = "system" if box.inside is not None else "part"
    yield f'<g transform="translate({box.x:.1f} {box.y:.1f})">'
    yield f'<rect class="{kind}" width="{box.width:.1f}" height="{box.height:.1f}" rx="6"/>'
    yield f'<text class="title" x="{_PAD}" y="17">{_shown(box.title)}</text>'
    if box.note:
        yield f'<text class="note" x="{_PAD}" y="32">{_shown(box.note)}</text>'
    if box.inside is not None:
        yield f'<g transform="translate({box.inside.left:.1f} {_HEAD:.1f})">'
        yield from _lines(box)
        for column in box.inside.columns:
            for inner in column:
                if inner.title:
                    yield from _drawn(inner)
        yield "</g>"
    for names, out in ((box.ins, False), (box.outs, True)):
        anchor, shift = ("end", -7) if out else ("start", 7)
        for name, label in names.items():
            x, y = box.port(name, out=out, within=True)
            yield f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.5"/>'
            yield (
                f'<text class="port" text-anchor="{anchor}" x="{x + shift:.1f}" y="{y + 4:.1f}">'
                f"{_shown(label)}</text>"
            )
    yield "</g>"


def _lines(box: _Box) -> Iterator[str]:
    """The connections in a system."""
    inside = box.inside
    assert inside is not None
    edges = [
        (max((b.x + b.width for b in column), default=0.0), min((b.x for b in column), default=0.0))
        for column in inside.columns
    ]
    column_of = {id(b): i for i, column in enumerate(inside.columns) for b in column}
    for way, line in inside.forward:
        points = []
        for i, passed in enumerate(way):
            if passed is None:  # the system's own connector
                end = line.source if i == 0 else line.target
                _, y = box.port(end[1], out=i > 0, within=True)
                y -= _HEAD
                if i == 0:  # from behind its own text to behind the longest one
                    points += [(_wide([box.ins[end[1]]]) + _PAD - inside.left, y), (0.0, y)]
                else:
                    edge = box.width - inside.left - _PAD
                    points += [(edge - _wide(box.outs.values()) - _PAD / 2, y),
                               (edge - _wide([box.outs[end[1]]]), y)]
                continue
            if i > 0:
                name = line.target[1] if passed.title else ""
                points.append(passed.port(name, out=False))
            if i < len(way) - 1:
                x, y = passed.port(line.source[1] if passed.title else "", out=True)
                points += [(x, y), (edges[column_of[id(passed)]][0], y)]
        yield _path(_smooth(points), line, inside)
    bottom = inside.height
    for lane, (source, target, line) in enumerate(inside.back):
        y = bottom - _LANE * (lane + 0.5)
        (x1, y1), (x2, y2) = source.port(line.source[1], out=True), target.port(
            line.target[1], out=False
        )
        out = edges[column_of[id(source)]][0] + 8 + 5 * (lane % 5)
        into = edges[column_of[id(target)]][1] - 8 - 5 * (lane % 5)
        path = f"M{x1:.1f} {y1:.1f}H{out:.1f}V{y:.1f}H{into:.1f}V{y2:.1f}H{x2:.1f}"
        yield _path(path, line, inside)


def _smooth(points: Sequence[tuple[float, float]]) -> str:
    (x, y), *rest = points
    path = f"M{x:.1f} {y:.1f}"
    for x2, y2 in rest:
        if y2 == y:
            path += f"H{x2:.1f}"
        else:
            middle = (x + x2) / 2
            path += f"C{middle:.1f} {y:.1f} {middle:.1f} {y2:.1f} {x2:.1f} {y2:.1f}"
        x, y = x2, y2
    return path


def _path(path: str, line: Line, inside: _Inside) -> str:
    number = inside.colours[line.source[0]] % len(THEMES["light"].receivers)
    names = ".".join((*line.source[0], line.source[1])), ".".join((*line.target[0], line.target[1]))
    said = f"{names[0]} → {names[1]}" + (f": {line.what}" if line.what else "")
    dashed = ' stroke-dasharray="6 3"' if line.what else ""
    return f'<path class="c{number}" d="{path}"{dashed}><title>{escape(said)}</title></path>'


def _style() -> str:
    rules = []
    for name, theme in THEMES.items():
        colours = "".join(
            f"--c{number}:{colour};" for number, colour in enumerate(theme.receivers)
        )
        rule = (
            f"svg{{--paper:{theme.paper};--ink:{theme.ink};--grid:{theme.grid};"
            f"--soft:{theme.soft};{colours}background:var(--paper)}}"
        )
        rules.append(
            rule if name == "light" else f"@media (prefers-color-scheme:dark){{{rule}}}"
        )
    rules += [f".c{i}{{stroke:var(--c{i})}}" for i in range(len(THEMES["light"].receivers))]
    return (
        f"<style>{''.join(rules)}"
        "path{fill:none;stroke-width:1.5;stroke-linejoin:round}"
        "rect{stroke:var(--soft);fill:var(--paper)}rect.system{stroke-dasharray:2 3}"
        "circle{fill:var(--ink)}text{fill:var(--ink);font:11px sans-serif}"
        ".title{font-size:13px;font-weight:bold}.note{fill:var(--ink);opacity:.75}</style>"
    )


def _wide(texts: Iterable[str]) -> float:
    return max((min(len(text), _LONGEST) for text in texts), default=0) * _CHAR


def _shown(text: str) -> str:
    """Contents of a text element."""
    if len(text) <= _LONGEST:
        return escape(text)
    return f"{escape(text[: _LONGEST - 1])}…<title>{escape(text)}</title>"
