"""SSP packages, ours and those of others, are run as the systems that they describe."""

from __future__ import annotations

import json
import math
import re
import warnings
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import as_recorded
import numpy as np
import pytest
import sblcosim
from quick import one_in
from sblcosim.cli import app
from sblcosim.data.record import Record
from sblcosim.errors import ConfigurationError, ConfigurationWarning, FmuError
from sblcosim.export.ssp import export_ssp
from sblcosim.fmus.build.factory import build
from sblcosim.fmus.files import scratch
from sblcosim.judge import metrics
from sblcosim.packages.documents import SPACES as READ
from sblcosim.packages.drawing import lines_of
from sblcosim.packages.picture import svg
from sblcosim.packages.read import opened
from sblcosim.packages.structure import NAMESPACES
from sblcosim.packages.units import conversion, unit_of
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.execution import execute
from sblcosim.simulation.resolve import resolve
from sblcosim.simulation.system import Conversion
from stranger import build_stranger
from synthetic_record import track
from typer.testing import CliRunner

DIVE: dict[str, Any] = {
    "name": "dive",
    "time": {"sampling_time_s": 0.1, "ekf_ratio": 2, "duration_s": 10.0},
    "receiver": {"type": "ekf", "prior": "true"},
}
SPACES = " ".join(f'xmlns:{prefix}="{uri}"' for prefix, uri in NAMESPACES.items())
UNITS = (
    '<ssd:Units><ssc:Unit name="km"><ssc:BaseUnit m="1" factor="1000"/></ssc:Unit>'
    '<ssc:Unit name="shifted"><ssc:BaseUnit m="1" factor="0.5" offset="3"/></ssc:Unit>'
    '<ssc:Unit name="m"><ssc:BaseUnit m="1"/></ssc:Unit>'
    '<ssc:Unit name="kg"><ssc:BaseUnit kg="1"/></ssc:Unit></ssd:Units>'
)
EXPERIMENT = '<ssd:DefaultExperiment startTime="0" stopTime="1"/>'


def same(record: Record, expected: Record) -> None:
    """All outputs but those of the raw fix, to the bit."""
    wanted = {key for key in expected.values if not key.startswith("raw.")}
    assert record.values.keys() == wanted
    assert record.time_ns.tolist() == expected.time_ns.tolist()
    for key in wanted:
        assert record.values[key].tobytes() == expected.values[key].tobytes(), key


# --- Our packages ---------------------------------------------------------------------------------


@one_in(2)
@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("name", sblcosim.scenarios())
def test_every_scenario_comes_back_to_the_bit(name: str, version: int, tmp_path: Path) -> None:
    scenario = sblcosim.load(name, {"time.duration_s": 20.0})
    file = export_ssp(scenario, tmp_path / "x.ssp", version=version)
    expected = execute(resolve(connect(scenario, fmi=version + 1)))
    result = sblcosim.run(file)
    same(result.record, expected)
    assert not result.remarks
    assert list(result.receivers) == [scenario.receiver.type]
    tracks = {name: track(expected, name) for name in result.receivers}
    assert result.errors.equals(metrics.error_table(tracks))


@pytest.mark.parametrize("master", ["native", "python", "lanes"])
def test_a_receiver_that_is_updated_less_often_comes_back(master: str, tmp_path: Path) -> None:
    file = export_ssp(DIVE, tmp_path / "x.ssp", ("ekf", "sequential"))
    result = sblcosim.run(str(file), master=master)
    same(result.record, execute(resolve(connect(sblcosim.load(DIVE), ("ekf", "sequential")))))
    assert result.record.intervals_ns["ekf"] == 2 * result.record.intervals_ns["target"]
    assert result.receivers == ("ekf", "sequential")
    assert result.update_interval_ns == 200_000_000


@pytest.mark.slow
def test_a_baked_package_comes_back(tmp_path: Path) -> None:
    file = export_ssp(DIVE, tmp_path / "x.ssp", bake=True)
    same(sblcosim.run(file).record, execute(resolve(connect(sblcosim.load(DIVE)))))


def test_the_command_writes_what_it_writes_of_a_scenario(tmp_path: Path) -> None:
    file = export_ssp(DIVE, tmp_path / "a-dive.ssp")
    done = CliRunner().invoke(app, ["run", str(file), "--out", str(tmp_path / "out"), "--json"])
    assert done.exit_code == 0, done.stderr
    assert json.loads(done.stdout)["errors"]["ekf"]["absolute"]["total"]["rms_m"] > 0
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert {"record.csv", "record.parquet", "errors.csv", "manifest.json", "errors.png"} <= names
    about = json.loads((tmp_path / "out" / "manifest.json").read_text())
    assert about["scenario_name"] == "a-dive"
    assert about["seeds"]["target"] == sblcosim.load(DIVE).target.seed
    # What a package lacks, as docs/howto/other-tools.md says.
    assert not {"scenario.toml", "path.geojson", "path.gpx"} & names
    assert json.loads(done.stdout)["limits"] == {}
    smooth = CliRunner().invoke(app, ["smooth", str(tmp_path / "out")])
    assert smooth.exit_code == 2
    assert "out: a run of a package cannot be smoothed" in smooth.stderr


def test_the_default_folder_has_the_name_of_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    export_ssp(DIVE, tmp_path / "a-dive.ssp")
    done = CliRunner().invoke(app, ["run", "a-dive.ssp", "--no-figures"])
    assert "written to runs/a-dive\n" in done.stdout
    assert not [path for path in scratch().iterdir() if (path / "resources").exists()]


def test_the_plan_is_printed(tmp_path: Path) -> None:
    file = export_ssp(DIVE, tmp_path / "x.ssp")
    done = CliRunner().invoke(app, ["plan", str(file)])
    assert len(done.stdout.splitlines()) < 24
    assert "unit" not in done.stdout  # nothing is converted
    done = CliRunner().invoke(app, ["plan", str(file), "--verbose"])
    assert done.exit_code == 0, done.stderr
    assert "ekf        ekf.fmu        2" in done.stdout
    assert "to                                  unit\n" in done.stdout  # nothing is converted
    assert json.loads(CliRunner().invoke(app, ["plan", str(file), "--json"]).stdout)["components"]


@pytest.mark.parametrize("command", ["run", "plan"])
@pytest.mark.parametrize(
    ("option", "value"),
    [("--receiver", "ekf"), ("--set", "seed=2"), ("--fmi", "2"), ("--seed", "0")],
)
def test_options_that_make_no_sense_are_refused(command: str, option: str, value: str) -> None:
    done = CliRunner().invoke(app, [command, "x.ssp", option, value])
    assert done.exit_code == 2
    assert re.fullmatch(
        rf"error: {option}: must be left out for an SSP package, .*, got {value}\n", done.stderr
    )


def test_arguments_that_make_no_sense_are_refused() -> None:
    given: dict[str, Any] = {
        "receiver": "ekf", "overrides": {"seed": 2}, "fmi": 3, "components": {"target": "x.fmu"},
    }  # fmt: skip
    for name, value in given.items():
        with pytest.raises(ConfigurationError, match=f"^{name}: must be left out for an SSP pack"):
            sblcosim.run("x.ssp", **{name: value})


# --- Packages of others ---------------------------------------------------------------------------


@pytest.fixture(scope="module", params=[2, 3])
def fmi(request: pytest.FixtureRequest) -> int:
    return request.param


@pytest.fixture(scope="module")
def stranger(fmi: int, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two inputs u, and y[:,1] = gain u + offset."""
    return build_stranger(fmi, tmp_path_factory.mktemp("stranger"))


@pytest.fixture(scope="module")
def stranger2(tmp_path_factory: pytest.TempPathFactory) -> Path:
    def with_km(xml: str) -> str:
        now = 'variability="discrete"><Real unit="s"/>'
        assert now in xml
        xml = xml.replace(now, 'variability="discrete"><Real unit="km"/>')
        km = '<Unit name="km"><BaseUnit m="1" factor="1000"/></Unit></UnitDefinitions>'
        return xml.replace("</UnitDefinitions>", km)

    return build_stranger(2, tmp_path_factory.mktemp("stranger2"), with_km)


def component(name: str, inside: str = "", more: str = "") -> str:
    return (
        f'<ssd:Component name="{name}" source="resources/a%20b.fmu" {more}>{inside}</ssd:Component>'
    )


def link(start: str, end: str, inside: str = "", more: str = "") -> str:
    (a, x), (b, y) = start.split("."), end.split(".")
    start_element = f'startElement="{a}"' if a else ""
    end_element = f'endElement="{b}"' if b else ""
    return (
        f'<ssd:Connection {start_element} startConnector="{x}" {end_element} endConnector="{y}" '
        f"{more}>{inside}</ssd:Connection>"
    )


def values(*parameters: tuple[str, str, str], more: str = "", units: str = "") -> str:
    inside = "".join(
        f'<ssv:Parameter name="{name}"><ssv:{kind} {value}/></ssv:Parameter>'
        for name, kind, value in parameters
    )
    return (
        f"<ssd:ParameterBinding {more}><ssd:ParameterValues>"
        f'<ssv:ParameterSet version="1.0" name="x"><ssv:Parameters>{inside}</ssv:Parameters>{units}'
        "</ssv:ParameterSet></ssd:ParameterValues></ssd:ParameterBinding>"
    )


def bound(*bindings: str) -> str:
    return f"<ssd:ParameterBindings>{''.join(bindings)}</ssd:ParameterBindings>"


def package(
    folder: Path,
    fmu: Path,
    elements: str,
    links: str = "",
    system: str = "",
    after: str = UNITS + EXPERIMENT,
    version: str = "1.0",
    others: Mapping[str, Path | str] | None = None,
    **files: str,
) -> Path:
    """Write a package with an FMU and other files; `system` goes before the elements."""
    path = folder / "x.ssp"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(
            "SystemStructure.ssd",
            f'<ssd:SystemStructureDescription {SPACES} name="x" version="{version}">'
            f'<ssd:System name="s">{system}<ssd:Elements>{elements}</ssd:Elements>'
            f"<ssd:Connections>{links}</ssd:Connections></ssd:System>{after}"
            "</ssd:SystemStructureDescription>",
        )
        archive.write(fmu, "resources/a b.fmu")
        for name, content in files.items():
            archive.writestr(f"resources/{name}.ssv", content)
        for name, other in (others or {}).items():
            content = other.encode() if isinstance(other, str) else other.read_bytes()
            archive.writestr(f"resources/{name}", content)
    return path


def settings(path: Path) -> dict[str, Any]:
    with opened(path) as found:
        plan = resolve(found.system)
    return {f"{c.name}.{s.port.name}": s.values for c in plan.components for s in c.settings}


def links_between(fmi: int, source: str = "y") -> str:
    """y[:,1] of a to u of b: elements in FMI 2; FMI 3 has no such part of an array."""
    if fmi == 2:
        return link("a.y[1,1]", "b.u[1]") + link("a.y[2,1]", "b.u[2]")
    return link("a.steps", "b.n")


def test_a_package_of_somebody_else_runs(fmi: int, stranger: Path, tmp_path: Path) -> None:
    size = {2: ["u[1]", "u[2]"], 3: ["u"]}[fmi]
    inputs = [(name, "Real", f'value="{v}"') for name, v in zip(size, "12", strict=False)]
    if fmi == 3:
        inputs = [("u", "Float64", 'value="1 2"')]
    first = bound(values(("gain", "Real", 'value="2"'), *inputs, ("n", "Integer", 'value="3"')))
    path = package(tmp_path, stranger, component("a", first) + component("b"), links_between(fmi))
    result = sblcosim.run(path)
    out = result.record.values
    assert out["a.y"][-1, :, 0].tolist() == [2.0, 4.0]
    if fmi == 2:
        assert out["b.y"][-1, :, 0].tolist() == [2.0, 4.0]
    else:
        assert out["b.steps"][-1] > out["a.steps"][-1]
    assert result.receivers == ()
    assert result.remarks == [
        "communication interval 0.001 s: a 1000th of the run, as neither the package nor its FMUs "
        "give a step size"
    ]
    assert result.errors.empty
    assert result.estimates.empty
    assert "receiver" in result.estimates
    assert "a.y[1,1]" in result.text()
    assert "1001 instants" in repr(result)
    assert "a.y[1,1]" in result._repr_html_()
    assert result.to_xarray()["a_y"].shape == (1001, 2, 2)
    done = CliRunner().invoke(app, ["run", str(path), "--out", str(tmp_path / "out"), "--json"])
    assert done.exit_code == 0, done.stderr
    assert json.loads(done.stdout)["errors"] == {}
    assert {p.name for p in (tmp_path / "out").iterdir()} == {
        "manifest.json", "record.csv", "record.parquet",
    }  # fmt: skip


@pytest.mark.parametrize("master", ["native", "python"])
def test_units_are_converted(master: str, stranger2: Path, tmp_path: Path) -> None:
    connections = link("a.now", "b.u[1]") + link(
        "a.now", "b.u[2]", more='suppressUnitConversion="true"'
    )
    path = package(tmp_path, stranger2, component("a") + component("b"), connections)
    out = sblcosim.run(path, master=master).record.values
    assert np.array_equal(out["b.y"][1:, 0, 0], out["a.now"][:-1] * 1000.0)
    assert np.array_equal(out["b.y"][1:, 1, 0], out["a.now"][:-1])
    assert out["a.now"][-1] == 1.0


@pytest.mark.parametrize("master", ["native", "python"])
def test_a_connection_is_transformed(master: str, stranger2: Path, tmp_path: Path) -> None:
    by = '<ssc:LinearTransformation factor="0.1" offset="0.3"/>'
    path = package(
        tmp_path, stranger2, component("a") + component("b"),
        link("a.now", "b.u[1]", by, 'suppressUnitConversion="true"'),
    )  # fmt: skip
    out = sblcosim.run(path, master=master).record.values
    assert np.array_equal(out["b.y"][1:, 0, 0], out["a.now"][:-1] * 0.1 + 0.3)


def test_masters_agree_on_conversions_and_lanes_refuse_them() -> None:
    system = connect(sblcosim.load(DIVE))
    first, *rest = system.connections
    changed = replace(first, conversion=Conversion(1.1, 0.7))
    plan = resolve(replace(system, connections=(changed, *rest)))
    one, other = (execute(plan, master=master) for master in ("native", "python"))
    for key, value in one.values.items():
        assert value.tobytes() == other.values[key].tobytes(), key
    plain = execute(resolve(system))
    assert not np.array_equal(plain.values["acoustics.range"], one.values["acoustics.range"])
    with pytest.raises(ConfigurationError, match="acoustics: must have inputs that are whole outp"):
        execute(plan, master="lanes")


def test_an_element_has_one_source(stranger2: Path, tmp_path: Path) -> None:
    both = link("a.y[1,1]", "b.u[1]") + link("a.now", "b.u[1]")
    path = package(tmp_path, stranger2, component("a") + component("b"), both)
    with pytest.raises(ConfigurationError, match=r"b\.u\[1\]: an input must have one source"):
        sblcosim.run(path)


def test_a_connectors_own_unit_comes_first(stranger2: Path, tmp_path: Path) -> None:
    own = (
        '<ssd:Connectors><ssd:Connector name="now" kind="output"><ssc:Real unit="shifted"/>'
        "</ssd:Connector></ssd:Connectors>"
    )
    path = package(
        tmp_path, stranger2, component("a", own) + component("b"), link("a.now", "b.u[2]")
    )
    with opened(path) as found:
        (connection,) = found.system.connections
    assert (connection.target, connection.conversion) == ("b.u[2]", Conversion(0.5, 3.0))


def test_an_fmu_that_fails_is_named_with_its_package(stranger2: Path, tmp_path: Path) -> None:
    own = bound(values(("gain", "Real", 'value="-1"')))
    path = package(tmp_path, stranger2, component("a", own))
    with pytest.raises(FmuError, match=r"x\.ssp: a: ") as caught:
        sblcosim.run(path)
    assert str(scratch()) not in str(caught.value)
    nothing = bytearray(stranger2.read_bytes())
    for name in ("binaries/linux64", "binaries/darwin64"):
        nothing = nothing.replace(name.encode(), b"B" + name[1:].encode())
    (tmp_path / "nothing.fmu").write_bytes(nothing)
    path = package(tmp_path, tmp_path / "nothing.fmu", component("a"))
    with pytest.raises(ConfigurationError) as other:
        sblcosim.run(path)
    assert str(other.value).startswith(f"{path}/resources/a b.fmu: must have a binary for ")


def test_whole_arrays_are_connected_as_such(stranger2: Path, tmp_path: Path) -> None:
    names = [f"[{i},{j}]" for i in (1, 2) for j in (1, 2)]
    path = package(
        tmp_path, stranger2, component("a") + component("b"),
        "".join(link(f"a.y{n}", f".y{n}") for n in names) + link("a.y[1,2]", "b.u[1]"),
    )  # fmt: skip
    with opened(path) as found:  # what leaves the system goes nowhere
        assert [(c.source, c.target) for c in found.system.connections] == [("a.y[1,2]", "b.u[1]")]


def test_temperatures_and_angles_become_each_other() -> None:
    celsius, fahrenheit = (
        unit_of({"K": "1", "factor": factor, "offset": offset})
        for factor, offset in (("1", "273.15"), ("0.5555555555555556", "255.3722222222222"))
    )
    found = conversion(celsius, fahrenheit)
    assert found.factor * 100 + found.offset == pytest.approx(212)
    degrees = unit_of({"rad": "1", "factor": repr(math.pi / 180)})
    assert conversion(degrees, unit_of({"rad": "1"})).factor * 180 == pytest.approx(math.pi)


def test_bindings_have_prefixes_units_and_an_order(stranger2: Path, tmp_path: Path) -> None:
    own = bound(
        values(("gain", "Real", 'value="1"'), ("offset[2]", "Real", 'value="1"')),
        '<ssd:ParameterBinding source="resources/more.ssv"/>',
        values(("et[1]", "Real", 'value="2" unit="km"'), more='prefix="offs"'),
    )
    system = bound(
        values(("gain", "Real", 'value="5"'), more='prefix="b."'),
        values(("all", "Real", 'value="7"')),
    )
    more = (
        f'<ssv:ParameterSet {SPACES} version="1.0" name="x"><ssv:Parameters>'
        '<ssv:Parameter name="gain"><ssv:Real value="4"/></ssv:Parameter>'
        "</ssv:Parameters></ssv:ParameterSet>"
    )
    path = package(
        tmp_path, stranger2, component("a", own) + component("b", own),
        link(".all", "a.u[2]") + link(".all", "b.fail_at"), system, more=more,
    )  # fmt: skip
    assert settings(path) == {
        "a.gain": (4.0,), "a.offset": (2000.0, 1.0), "a.u": (0.0, 7.0),
        "b.gain": (5.0,), "b.offset": (2000.0, 1.0), "b.fail_at": (7.0,),
    }  # fmt: skip


@pytest.mark.parametrize(
    ("own", "where"),
    [
        ('<ssd:ParameterBinding source="resources/more.ssv"/>', "resources/more.ssv: "),
        (values(("range_std", "Real", 'value="-5"')), ""),
    ],
)
def test_a_value_out_of_bounds_is_named_with_its_file(
    own: str, where: str, tmp_path: Path
) -> None:
    more = (
        f'<ssv:ParameterSet {SPACES} version="1.0" name="x"><ssv:Parameters>'
        '<ssv:Parameter name="range_std"><ssv:Real value="-5"/></ssv:Parameter>'
        "</ssv:Parameters></ssv:ParameterSet>"
    )
    path = package(tmp_path, build("acoustics", 2), component("a", bound(own)), more=more)
    with pytest.raises(ConfigurationError) as caught, opened(path):
        pass
    assert str(caught.value) == f"{path}: {where}a.range_std: must be at least 0 m, got -5.0 m"


@pytest.mark.parametrize("given", ["", "1", "1 2", "1 2 3"])
def test_a_parameter_has_as_many_values_as_elements(
    given: str, fmi: int, stranger: Path, tmp_path: Path
) -> None:
    name, size = {2: ("offset[1]", 1), 3: ("offset", 2)}[fmi]
    own = bound(values((name, "Float64", f'value="{given}"')))
    path = package(tmp_path, stranger, component("a", own))
    count = len(given.split())
    if count == size:
        assert settings(path)["a.offset"][:size] == tuple(map(float, given.split()))
        return
    with pytest.raises(ConfigurationError) as caught:
        settings(path)
    assert str(caught.value) == f"{path}: a.{name}: must have {size} values, got {count}"


def test_a_parameter_of_nothing_is_warned_of(stranger2: Path, tmp_path: Path) -> None:
    path = package(
        tmp_path, stranger2, component("a", bound(values(("gian", "Real", 'value="1"'))))
    )
    with pytest.warns(ConfigurationWarning, match=r"a: parameter 'gian' has no effect.*'gain'\?"):
        assert settings(path) == {}


@pytest.mark.parametrize(("outside", "more"), [
    (False, " and 4 more"), (True, " and 5 more"), (False, " and 1 more"), (False, ""),
])  # fmt: skip
def test_parameters_of_nothing_are_warned_of_together(
    outside: bool, more: str, stranger2: Path, tmp_path: Path
) -> None:
    count = {" and 1 more": 9, "": 8}.get(more, 12)
    names = [f"part {i}.what" for i in range(count)]
    binding = bound(values(*((name, "Real", 'value="1"') for name in [*names, "gian"])))
    path = package(
        tmp_path, stranger2, component("a", "" if outside else binding),
        system=binding if outside else "",
    )  # fmt: skip
    with pytest.warns(ConfigurationWarning) as caught:
        assert settings(path) == {}
    listed = ", ".join(f"'{name}'" for name in names[:8])
    many = "have no effect: there are no such variables"
    if outside:  # nothing there is called like "gian"
        expected = [f"parameters of the system: {listed}{more} {many}"]
    else:
        expected = [
            "a: parameter 'gian' has no effect: there is no such variable; did you mean 'gain'?",
            f"a: parameters {listed}{more} {many}",
        ]
    assert [str(w.message) for w in caught] == [f"{path}: {words}" for words in expected]


@pytest.mark.parametrize(
    ("annotation", "step", "whose"),
    [
        ('<ssc:Annotation type="org.openmodelica"><oms:Annotations><oms:SimulationInformation>'
         '<oms:FixedStepMaster stepSize="0.25"/></oms:SimulationInformation></oms:Annotations>'
         "</ssc:Annotation>", 250_000_000, "OMSimulator"),
        ('<ssc:Annotation type="com.opensimulationplatform"><osp:Algorithm><osp:FixedStepAlgorithm '
         'baseStepSize="0.5"/></osp:Algorithm></ssc:Annotation>', 500_000_000,
         "the Open Simulation Platform"),
    ],
)  # fmt: skip
def test_the_steps_of_other_tools_are_taken(
    annotation: str, step: int, whose: str, stranger2: Path, tmp_path: Path
) -> None:
    after = EXPERIMENT + f"<ssd:Annotations>{annotation}</ssd:Annotations>"
    with opened(package(tmp_path, stranger2, component("a"), after=after)) as found:
        assert found.system.components["a"].interval_ns == step
    assert found.remarks == (
        f"communication interval {step / 1e9:g} s: the step that the package gives for {whose}",
    )


def test_what_the_package_leaves_open_the_fmus_say(tmp_path: Path) -> None:
    def with_experiment(xml: str) -> str:
        return xml.replace(
            "<ModelVariables>", '<DefaultExperiment stopTime="2" stepSize="0.1"/><ModelVariables>'
        )

    fmu = build_stranger(2, tmp_path / "built", with_experiment)
    path = package(tmp_path, fmu, component("a"), after="")
    result = sblcosim.run(path)
    assert len(result.record) == 21
    assert [remark.partition(":")[0] for remark in result.remarks] == [
        "stop time 2 s", "communication intervals",
    ]  # fmt: skip


# --- Systems in systems ------------------------------------------------------------------------


def connectors(*given: str) -> str:
    """From ``name kind`` or ``name kind unit``."""
    inside = ""
    for name, kind, *unit in (text.split() for text in given):
        typed = f'<ssc:Real unit="{unit[0]}"/>' if unit else "<ssc:Real/>"
        inside += f'<ssd:Connector name="{name}" kind="{kind}">{typed}</ssd:Connector>'
    return f"<ssd:Connectors>{inside}</ssd:Connectors>"


def inner(name: str, elements: str, links: str = "", before: str = "", after: str = "") -> str:
    return (
        f'<ssd:System name="{name}">{before}<ssd:Elements>{elements}</ssd:Elements>'
        f"<ssd:Connections>{links}</ssd:Connections>{after}</ssd:System>"
    )


def turned(links: str) -> str:
    """The same connections, with the other end as the start."""
    return links.replace("start", "?").replace("end", "start").replace("?", "end")


def conversions(path: Path) -> dict[str, tuple[str, tuple[Conversion, ...]]]:
    """Of all connections by target: the source, and what becomes of values."""
    with opened(path) as found:
        resolve(found.system)
        return {
            c.target: (c.source, (c.conversion or Conversion()).steps)
            for c in found.system.connections
        }


@pytest.mark.parametrize("turn", [str, turned])
def test_the_kinds_of_connectors_decide_where_values_go(
    turn: Callable[[str], str], stranger2: Path, tmp_path: Path
) -> None:
    nested = inner("s", component("b"), turn(link(".i", "b.u[1]") + link("b.y[1,1]", ".o")),
                   connectors("i input", "o output"))  # fmt: skip
    links = turn(
        link(".x", "a.u[1]") + link("a.y[1,1]", "s.i") + link("s.o", "c.u[2]")
        + link("c.y[2,1]", ".z") + link(".x", ".through")
    )  # fmt: skip
    own = connectors("x input", "z output", "through output")
    path = package(
        tmp_path, stranger2, component("a") + nested + component("c"), links,
        own + bound(values(("x", "Real", 'value="3.013"'))),
    )  # fmt: skip
    out = sblcosim.run(path).record.values
    assert out["a.y"][-1, 0, 0] == 3.013
    assert out["s/b.y"][-1, 0, 0] == out["c.y"][-1, 1, 0] == 3.013


@pytest.mark.parametrize("turn", [str, turned])
def test_ends_that_both_give_or_take_are_refused(
    turn: Callable[[str], str], stranger2: Path, tmp_path: Path
) -> None:
    two = component("a") + component("b")
    for one, other, kinds in (
        ("a.now", "b.now", "output 'a.now' and output 'b.now'"),
        ("a.u[1]", "b.gain", "input 'a.u[1]' and parameter 'b.gain'"),
        (".x", "a.now", "input 'x' and output 'a.now'"),
    ):
        path = package(tmp_path, stranger2, two, turn(link(one, other)), connectors("x input"))
        with pytest.raises(ConfigurationError, match="must connect an output with an input, got "):
            sblcosim.run(path)
        if turn is str:
            with pytest.raises(ConfigurationError, match=re.escape(kinds)):
                sblcosim.run(path)


def test_a_system_has_the_connectors_that_it_lists(stranger2: Path, tmp_path: Path) -> None:
    nested = inner("s", component("b"), link(".i", "b.u[1]"), connectors("i input"))
    path = package(tmp_path, stranger2, component("a") + nested, link("a.now", "s.j"))
    with pytest.raises(ConfigurationError, match=r"endConnector must be a connector of 's', got"):
        sblcosim.run(path)
    path = package(tmp_path, stranger2, inner("s", component("b"), link(".i", "c.u[1]")))
    with pytest.raises(ConfigurationError, match=r"connection of 'u\[1\]': endElement must be a"):
        sblcosim.run(path)


def test_connectors_in_a_circle_are_refused(stranger2: Path, tmp_path: Path) -> None:
    both = connectors("i input", "o output")
    nested = [inner(name, component("b"), link(".i", ".o"), both) for name in "st"]
    path = package(
        tmp_path, stranger2, "".join(nested), link("s.o", "t.i") + link("t.o", "s.i")
    )
    with pytest.raises(ConfigurationError, match="must come from a component, got a circle"):
        sblcosim.run(path)


@pytest.mark.parametrize("turn", [str, turned])
@pytest.mark.parametrize(
    ("units", "steps"),
    [
        (("m", ""), [Conversion(1000.0)]),
        (("", ""), [Conversion(1000.0)]),
        (("shifted", ""), [Conversion(1000.0)]),  # there and back changes nothing
        (("", "shifted"), [Conversion(2000.0, -6.0)]),
        (("m", "km"), []),
    ],
)
def test_units_are_converted_at_every_connector(
    units: tuple[str, str], steps: list[Conversion], turn: Callable[[str], str], stranger2: Path,
    tmp_path: Path,
) -> None:  # fmt: skip
    through, last = units
    target = component("b", connectors(f"u[1] input {last}") if last else "")
    deep = inner("t", target, turn(link(".i", "b.u[1]")), connectors(f"i input {through}"))
    nested = inner("s", deep, turn(link(".j", "t.i")), connectors("j input"))
    own = connectors(f"o output {through}")
    source = inner("r", component("a"), turn(link("a.now", ".o")), own)
    path = package(tmp_path, stranger2, source + nested, turn(link("r.o", "s.j")))
    assert conversions(path) == {"s/t/b.u[1]": ("r/a.now", tuple(steps))}


def test_a_unit_of_another_quantity_is_refused_on_the_way(stranger2: Path, tmp_path: Path) -> None:
    nested = inner("s", component("b"), link(".i", "b.u[1]"), connectors("i input kg"))
    path = package(tmp_path, stranger2, component("a") + nested, link("a.now", "s.i"))
    with pytest.raises(ConfigurationError, match=r"a\.now -> s\.i: must have .* 'km' and 'kg'"):
        sblcosim.run(path)
    path = package(
        tmp_path, stranger2, component("a", connectors("now output mile")) + component("b"),
        link("a.now", "b.u[1]"),
    )  # fmt: skip
    with pytest.raises(ConfigurationError, match=r"both units must be defined, got 'mile' and 'm'"):
        sblcosim.run(path)
    nested = inner("s", component("b"), link(".i", "b.u[1]"), connectors("i input mile"))
    path = package(tmp_path, stranger2, component("a") + nested, link("a.now", "s.i"))
    with pytest.raises(ConfigurationError, match=r"units must be defined, got 'km' and 'mile'"):
        sblcosim.run(path)
    path = package(
        tmp_path, stranger2, component("a", connectors("now output s")) + component("b"),
        link("a.now", "b.u[1]"),
    )  # fmt: skip
    with pytest.raises(ConfigurationError, match=r"a\.now -> b\.u\[1\]: must have .* 's' and 'm'"):
        sblcosim.run(path)


@pytest.mark.parametrize("master", ["native", "python"])
def test_units_come_before_transformations(
    master: str, stranger2: Path, tmp_path: Path
) -> None:
    by = '<ssc:LinearTransformation factor="0.1" offset="0.3"/>'
    nested = inner("s", component("b"), link(".i", "b.u[1]", by), connectors("i input shifted"))
    path = package(tmp_path, stranger2, component("a") + nested, link("a.now", "s.i", by))
    out = sblcosim.run(path, master=master).record.values
    at_connector = (out["a.now"][:-1] * 2000.0 - 6.0) * 0.1 + 0.3
    assert np.array_equal(out["s/b.y"][1:, 0, 0], (at_connector * 0.5 + 3.0) * 0.1 + 0.3)


@pytest.mark.parametrize(
    ("other", "steps"),
    [
        ("m", (Conversion(1000.0), Conversion(0.1, 0.3))),  # in m, as is all inside
        ("km", (Conversion(0.1, 0.3), Conversion(1000.0))),  # as it arrives
    ],
)
def test_a_connector_without_a_unit_has_that_of_all_inside(
    other: str, steps: tuple[Conversion, ...], stranger2: Path, tmp_path: Path
) -> None:
    by = '<ssc:LinearTransformation factor="0.1" offset="0.3"/>'
    two = component("b") + component("c", connectors(f"u[2] input {other}"))
    links = link(".i", "b.u[1]") + link("c.u[2]", ".i")
    path = package(
        tmp_path, stranger2, component("a") + inner("s", two, links, connectors("i input")),
        link("a.now", "s.i", by),
    )  # fmt: skip
    assert conversions(path)["s/b.u[1]"] == ("a.now", steps)


def test_a_set_knows_its_units_better_than_the_package(stranger2: Path, tmp_path: Path) -> None:
    units = '<ssv:Units><ssc:Unit name="km"><ssc:BaseUnit m="1" factor="8"/></ssc:Unit></ssv:Units>'
    two = (("u[1]", "Real", 'value="2" unit="km"'), ("u[2]", "Real", 'value="4" unit="shifted"'))
    own = bound(values(*two, units=units))
    path = package(tmp_path, stranger2, component("a", own) + component("b", bound(values(*two))))
    assert settings(path) == {"a.u": (16.0, 5.0), "b.u": (2000.0, 5.0)}


def test_a_suppressed_conversion_leaves_the_number(stranger2: Path, tmp_path: Path) -> None:
    not_ = 'suppressUnitConversion="true"'
    nested = inner("s", component("b"), link(".i", "b.u[1]"), connectors("i input shifted"))
    path = package(tmp_path, stranger2, component("a") + nested, link("a.now", "s.i", more=not_))
    assert conversions(path)["s/b.u[1]"] == ("a.now", (Conversion(0.5, 3.0),))


def test_names_of_components_stay_apart(stranger2: Path, tmp_path: Path) -> None:
    elements = component("s.b") + inner("s", component("b")) + component("s/b")
    path = package(
        tmp_path, stranger2, elements,
        system=bound(values(("s.b.gain", "Real", 'value="2"'), ("s/b.gain", "Real", 'value="3"'))),
    )  # fmt: skip
    assert settings(path) == {"s/b.gain": (2.0,), "s/b_2.gain": (2.0,), "s/b_3.gain": (3.0,)}
    assert "s_b_y" in sblcosim.run(path).to_xarray()


# --- Values of systems in systems -----------------------------------------------------------------


def test_values_of_outer_systems_come_first(stranger2: Path, tmp_path: Path) -> None:
    def gain(value: int, name: str = "gain", more: str = "") -> str:
        return bound(values((name, "Real", f'value="{value}"'), more=more))

    own = component("b", gain(1)) + component("c", gain(1)) + component("d", gain(1))
    deep = inner("t", own, link(".g", "c.gain"), connectors("g parameter") + gain(2, "g"))
    path = package(
        tmp_path, stranger2, component("b") + inner("s", deep, before=gain(3, "t.b.gain")),
        system=gain(4, "b.gain", 'prefix="s.t."'),
    )  # fmt: skip
    assert settings(path) == {"s/t/b.gain": (4.0,), "s/t/c.gain": (2.0,), "s/t/d.gain": (1.0,)}


@pytest.mark.parametrize("order", [1, -1])
def test_the_value_at_the_beginning_of_a_way_counts(
    order: int, stranger2: Path, tmp_path: Path
) -> None:
    given = [values((name, "Real", f'value="{v}"')) for name, v in
             (("x", 2), ("s.i", 3), ("s.b.gain", 4), ("s.c.gain", 5))]  # fmt: skip
    deep = inner("s", component("b") + component("c"), link(".i", "b.gain"),
                 connectors("i parameter"))  # fmt: skip
    path = package(
        tmp_path, stranger2, deep, link(".x", "s.i"),
        connectors("x parameter") + bound(*given[::order]),
    )  # fmt: skip
    assert settings(path) == {"s/b.gain": (2.0,), "s/c.gain": (5.0,)}


def test_a_parameter_of_one_name_belongs_to_its_component(stranger2: Path, tmp_path: Path) -> None:
    two = component("a", bound(values(("gain", "Real", 'value="2"')))) + component("b")
    system = bound(values(("b.gain", "Real", 'value="3"')), values(("b.n", "Integer", 'value="7"')))
    path = package(tmp_path, stranger2, two, system=system)
    assert settings(path) == {"a.gain": (2.0,), "b.gain": (3.0,), "b.n": (7,)}


@pytest.mark.parametrize(
    ("value", "own", "expected"),
    [
        ('value="0.002" unit="km"', "gain parameter m", 2.0),  # no unit in the FMU
        ('value="2"', "gain parameter km", 2.0),
        ('value="4" unit="shifted"', "gain parameter m", 5.0),
        ('value="5" unit="m"', "gain parameter shifted", 4.0),
        ('value="0.003" unit="km"', "u[1] input", 3.0),
        ('value="2" unit="km"', "u[1] input km", 2.0),  # the connector's unit comes first
        ('value="2" unit="inch"', "u[1] input m", 0.0508),  # of the set alone
        ('value="2" unit="km"', "fail_at parameter km", 2.0),
    ],
)
@pytest.mark.parametrize("where", ["inline", "external"])
def test_a_value_is_converted_to_the_unit_of_its_connector(
    where: str, value: str, own: str, expected: float, stranger2: Path, tmp_path: Path
) -> None:
    name = own.split()[0]
    units = (
        '<ssv:Units><ssc:Unit name="inch"><ssc:BaseUnit m="1" factor="0.0254"/></ssc:Unit>'
        "</ssv:Units>"
    )
    given = values((name, "Real", value), units=units)
    inside = given.partition("<ssd:ParameterValues>")[2].partition("</ssd:ParameterValues>")[0]
    more = inside.replace("<ssv:ParameterSet", f"<ssv:ParameterSet {SPACES}")
    binding = given if where == "inline" else '<ssd:ParameterBinding source="resources/more.ssv"/>'
    path = package(
        tmp_path, stranger2, component("a", connectors(own) + bound(binding)), more=more
    )
    found = settings(path)[f"a.{name.partition('[')[0]}"][0]
    assert found == pytest.approx(expected, rel=1e-15)
    # At a connector of the system with the unit, the component's without one.
    path = package(
        tmp_path, stranger2, component("a"), link(".x", f"a.{name}"),
        connectors(f"x parameter {' '.join(own.split()[2:])}")
        + bound(binding.replace(f'name="{name}"', 'name="x"')),
        more=more.replace(f'name="{name}"', 'name="x"'),
    )  # fmt: skip
    if name == "gain":
        with warnings.catch_warnings():
            warnings.simplefilter("error", ConfigurationWarning)
            assert settings(path)["a.gain"][0] == pytest.approx(expected, rel=1e-15)


def test_a_value_that_cannot_be_converted_is_named(stranger2: Path, tmp_path: Path) -> None:
    given = bound(values(("gain", "Real", 'value="1" unit="kg"')))
    path = package(tmp_path, stranger2, component("a", connectors("gain parameter m") + given))
    with pytest.raises(ConfigurationError, match=r"a\.gain: must be given in a unit that can bec"):
        settings(path)
    path = package(tmp_path, stranger2, component("a", given))
    with pytest.warns(ConfigurationWarning, match=r"x\.ssp: a\.gain: its value is given in kg and"):
        assert settings(path) == {"a.gain": (1.0,)}


MAPPING = (
    '<ssm:MappingEntry source="p" target="gain"/>'
    '<ssm:MappingEntry source="p" target="offset[1]">'
    '<ssc:LinearTransformation factor="0.1" offset="0.3"/></ssm:MappingEntry>'
    '<ssm:MappingEntry source="p" target="offset[2]" suppressUnitConversion="true">'
    '<ssc:LinearTransformation factor="2"/></ssm:MappingEntry>'
)
SSM = f'xmlns:ssm="{READ["ssm"]}" {SPACES} version="1.0"'


@pytest.mark.parametrize("level", ["component", "system"])
@pytest.mark.parametrize("where", ["inline", "external"])
def test_mappings_are_applied(
    where: str, level: str, stranger2: Path, tmp_path: Path
) -> None:
    whole = f"<ssm:ParameterMapping {SSM}>{MAPPING}</ssm:ParameterMapping>"
    prefix = ""
    if level == "system":
        whole = whole.replace('target="', 'target="a.').replace('source="', 'source="q.')
        prefix = 'prefix="q."'
    inside, source = (whole, "") if where == "inline" else ("", 'source="resources/map.ssm"')
    mapping = f"<ssd:ParameterMapping {source}>{inside}</ssd:ParameterMapping>"
    given = values(
        ("p", "Real", 'value="7" unit="shifted"'), ("fail_at", "Real", 'value="3"'), more=prefix
    )
    binding = bound(given.replace("</ssd:ParameterBinding>", f"{mapping}</ssd:ParameterBinding>"))
    own = connectors("gain parameter shifted")
    path = package(
        tmp_path, stranger2, component("a", own + (binding if level == "component" else "")),
        system=binding if level == "system" else "", others={"map.ssm": whole},
    )  # fmt: skip
    # 7 shifted are 6.5 m; what is not mapped is not applied.
    assert settings(path) == {"a.gain": (7.0,), "a.offset": (6.5 * 0.1 + 0.3, 14.0)}


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        (MAPPING + MAPPING, "of 'p' to 'gain': must be the only one to its target, got another"),
        ('<ssm:MappingEntry source="p" target="gain"><ssc:BooleanMappingTransformation/>'
         "</ssm:MappingEntry>", "to 'gain': must hold what can be simulated here, got Boolean"),
        ('<ssm:MappingEntry source="p" target="gain"><ssc:LinearTransformation factor="x"/>'
         "</ssm:MappingEntry>", "factor: must be a finite number, got 'x'"),
        ("<ssm:Entry/>", "ParameterMapping: must hold what can be simulated here, got Entry"),
    ],
)  # fmt: skip
def test_a_mapping_in_error_is_named(
    entries: str, message: str, stranger2: Path, tmp_path: Path
) -> None:
    whole = f"<ssm:ParameterMapping {SSM}>{entries}</ssm:ParameterMapping>"
    mapping = f"<ssd:ParameterMapping>{whole}</ssd:ParameterMapping></ssd:ParameterBinding>"
    given = values(("p", "Real", 'value="1"')).replace("</ssd:ParameterBinding>", mapping)
    path = package(tmp_path, stranger2, component("a", bound(given)))
    with pytest.raises(ConfigurationError, match=re.escape(message)):
        settings(path)


def test_a_mapping_of_what_is_not_there_is_warned_of(stranger2: Path, tmp_path: Path) -> None:
    entries = '<ssm:MappingEntry source="pp" target="gain"/>'
    whole = f"<ssm:ParameterMapping {SSM}>{entries}</ssm:ParameterMapping>"
    mapping = f"<ssd:ParameterMapping>{whole}</ssd:ParameterMapping></ssd:ParameterBinding>"
    given = values(("p", "Real", 'value="1"')).replace("</ssd:ParameterBinding>", mapping)
    path = package(tmp_path, stranger2, component("a", bound(given)))
    with pytest.warns(ConfigurationWarning, match="for parameters that the set lacks: 'pp'; did"):
        assert settings(path) == {}


@pytest.mark.parametrize(
    ("linear", "expected"),
    [
        ("", (3,)), ('<ssc:LinearTransformation factor="1"/>', (3,)),
        ('<ssc:LinearTransformation factor="2" offset="1"/>', None),
        ('<ssc:LinearTransformation offset="1"/>', None),
    ],
)  # fmt: skip
def test_a_whole_number_is_mapped_and_not_transformed(
    linear: str, expected: tuple[int] | None, stranger2: Path, tmp_path: Path
) -> None:
    entry = f'<ssm:MappingEntry source="p" target="fail_as">{linear}</ssm:MappingEntry>'
    whole = f"<ssm:ParameterMapping {SSM}>{entry}</ssm:ParameterMapping>"
    mapping = f"<ssd:ParameterMapping>{whole}</ssd:ParameterMapping></ssd:ParameterBinding>"
    given = values(("p", "Integer", 'value="3"')).replace("</ssd:ParameterBinding>", mapping)
    path = package(tmp_path, stranger2, component("a", bound(given)))
    if expected is not None:
        assert settings(path) == {"a.fail_as": expected}
        return
    with pytest.raises(ConfigurationError, match=r"a\.fail_as: must be a real number to be conv"):
        settings(path)


def test_two_parameters_that_a_set_lacks_are_named_without_a_guess(
    stranger2: Path, tmp_path: Path
) -> None:
    entries = "".join(f'<ssm:MappingEntry source="{name}" target="{to}"/>'
                      for name, to in (("pp", "gain"), ("q", "n"), ("pp", "offset[1]")))
    whole = f"<ssm:ParameterMapping {SSM}>{entries}</ssm:ParameterMapping>"
    mapping = f"<ssd:ParameterMapping>{whole}</ssd:ParameterMapping></ssd:ParameterBinding>"
    given = values(("p", "Real", 'value="1"')).replace("</ssd:ParameterBinding>", mapping)
    path = package(tmp_path, stranger2, component("a", bound(given)))
    with pytest.warns(ConfigurationWarning) as caught:
        assert settings(path) == {}
    assert [str(it.message).partition("ParameterMapping")[2] for it in caught] == [
        " has no effect for parameters that the set lacks: 'pp', 'q'"
    ]


def test_words_of_values_fit_their_types(stranger2: Path, tmp_path: Path) -> None:
    for word, on in (("true", True), ("1", True), ("false", False), ("0", False)):
        own = bound(values(("on", "Boolean", f'value="{word}"'), ("n", "Integer", 'value="-3"')))
        assert settings(package(tmp_path, stranger2, component("a", own))) == {
            "a.on": (on,), "a.n": (-3,),
        }
    for name, kind, word, must in (("on", "Boolean", "True", "true or false"),
                                   ("n", "Integer", "1.5", "a whole number"),
                                   ("gain", "Real", "x", "a number")):
        own = bound(values((name, kind, f'value="{word}"')))
        with pytest.raises(ConfigurationError) as caught:
            settings(package(tmp_path, stranger2, component("a", own)))
        assert str(caught.value).endswith(f"x.ssp: a.{name}: must be {must}, got '{word}'")


def test_units_that_change_nothing_need_no_unit_of_the_variable(
    stranger2: Path, tmp_path: Path
) -> None:
    more = UNITS.replace("</ssd:Units>", (
        '<ssc:Unit name="one"><ssc:BaseUnit/></ssc:Unit><ssc:Unit name="percent"><ssc:BaseUnit '
        'factor="0.01"/></ssc:Unit><ssc:Unit name="off"><ssc:BaseUnit offset="1"/></ssc:Unit>'
        "</ssd:Units>")) + EXPERIMENT  # fmt: skip
    for unit, told in (("one", False), ("percent", True), ("off", True), ("m", True)):
        own = bound(values(("gain", "Real", f'value="2" unit="{unit}"')))
        path = package(tmp_path, stranger2, component("a", own), after=more)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            assert settings(path) == {"a.gain": (2.0,)}
        assert [str(it.message) for it in caught] == told * [
            f"{path}: a.gain: its value is given in {unit} and taken as it is, as neither the "
            "connector nor the variable has a unit"
        ]


def test_a_unit_that_only_the_variable_knows_is_its_own(stranger2: Path, tmp_path: Path) -> None:
    own = bound(values(("offset[1]", "Real", 'value="2" unit="m"')))
    path = package(tmp_path, stranger2, component("a", own), after=EXPERIMENT)
    assert settings(path)["a.offset"][0] == 2.0
    own = bound(values(("offset[1]", "Real", 'value="2" unit="M"')))
    path = package(tmp_path, stranger2, component("a", own), after=EXPERIMENT)
    with pytest.raises(ConfigurationError, match=r"a: parameter 'offset\[1\]': must have a unit tha"
                       r"t is defined, got 'M'$"):
        settings(path)


def test_a_unit_in_brackets_is_read_without_them_and_said_once(
    stranger2: Path, tmp_path: Path
) -> None:
    own = bound(values(*((f"offset[{i}]", "Real", f'value="{i}" unit="[km]"') for i in (1, 2))))
    path = package(tmp_path, stranger2, component("a", own))
    assert settings(path) == {"a.offset": (1000.0, 2000.0)}
    with opened(path) as found:
        said = [it for it in found.remarks if "read as" in it]
    assert said == ["Component 'a': the unit '[km]' is read as 'km'"]


def test_several_values_may_leave_a_package_at_one_connector(
    stranger2: Path, tmp_path: Path
) -> None:
    links = link("a.now", ".x") + link("b.now", ".x") + link("a.now", "b.u[1]", more=(
        'suppressUnitConversion="1"'))  # fmt: skip
    path = package(tmp_path, stranger2, TWO, links, connectors("x output"))
    assert conversions(path) == {"b.u[1]": ("a.now", ())}
    with pytest.raises(ConfigurationError) as caught:
        settings(package(tmp_path, stranger2, TWO, links + link("a.y[1,1]", "b.u[1]")))
    assert str(caught.value).endswith(
        "connection a.y[1,1] -> b.u[1]: an input must have one source, got a.now as well"
    )


def test_connectors_that_lead_nowhere_are_said_to(stranger2: Path, tmp_path: Path) -> None:
    system = connectors("x input") + bound(values(("x", "Real", 'value="1"')))
    path = package(tmp_path, stranger2, component("a"), system=system)
    with pytest.warns(ConfigurationWarning) as caught:
        assert settings(path) == {}
    assert [str(w.message) for w in caught] == [
        f"{path}: parameter of the system: 'x' has no effect: its connector leads to no component"
    ]


def test_starts_that_the_fmu_lets_be_set_are_set(tmp_path: Path) -> None:
    def with_local(xml: str) -> str:
        now = 'name="fail_at" valueReference="300" causality="parameter" variability="fixed"'
        assert now in xml
        return xml.replace(
            now, 'name="fail_at" valueReference="300" causality="local" variability="continuous" '
            'initial="exact"',
        )  # fmt: skip

    fmu = build_stranger(2, tmp_path / "local", with_local)
    given = component("a", bound(values(("fail_at", "Real", 'value="0.5"'))))
    path = package(tmp_path, fmu, given)
    assert settings(path) == {"a.fail_at": (0.5,)}
    for master in ("native", "python"):
        with pytest.raises(FmuError, match=r"a: fmi2DoStep at 0\.5 s must succeed"):
            sblcosim.run(path, master=master)
    with pytest.raises(ConfigurationError, match=r"must have inputs that are whole outp|lanes"):
        sblcosim.run(path, master="lanes")


@pytest.mark.parametrize("master", ["native", "python"])
def test_texts_are_set(master: str, fmi: int, tmp_path: Path) -> None:
    def with_text(xml: str) -> str:
        if fmi == 2:
            text = (
                '<ScalarVariable name="text" valueReference="2400" causality="parameter" '
                'variability="fixed"><String start="x"/></ScalarVariable>'
            )
            return xml.replace("</ModelVariables>", f"{text}</ModelVariables>")
        text = (
            '<String name="text" valueReference="2400" causality="parameter" '
            'variability="fixed"><Start value="x"/></String>'
        )
        return xml.replace("</ModelVariables>", f"{text}</ModelVariables>")

    fmu = build_stranger(fmi, tmp_path / "text", with_text, ("-DTEXT",))
    two = component("a", bound(values(("text", "String", 'value="two words, ä"')))) + component("b")
    path = package(tmp_path, fmu, two)
    out = sblcosim.run(path, master=master).record.values
    assert out["a.y"][-1, 0, 0] == len("two words, ä".encode())
    assert out["b.y"][-1, 0, 0] == 0.0
    done = CliRunner().invoke(app, ["plan", str(path), "--verbose"])
    assert ["a.text", "String", "2400", "two", "words,", "ä"] in [
        line.split() for line in done.stdout.splitlines()
    ]


@pytest.mark.parametrize("master", ["native", "python"])
def test_a_local_variable_can_be_the_source(master: str, tmp_path: Path) -> None:
    def with_local(xml: str) -> str:
        now = 'name="now" valueReference="600" causality="output"'
        assert now in xml
        return xml.replace(now, now.replace("output", "local")).replace('<Unknown index="14" '
            'dependencies=""/>', "").replace('unit="s"', 'unit="m"')  # fmt: skip

    fmu = build_stranger(2, tmp_path / "local", with_local)
    two = component("a", connectors("now local")) + component("b")
    path = package(tmp_path, fmu, two, link("b.u[1]", "a.now"))
    out = sblcosim.run(path, master=master).record.values
    assert np.array_equal(out["b.y"][1:, 0, 0], out["a.now"][:-1])
    assert out["a.now"][-1] == 1.0
    assert "b.now" not in out


# --- Time -----------------------------------------------------------------------------------------


def experiment(stop: str = "", step: str = "") -> Callable[[str], str]:
    given = "".join(f' {k}="{v}"' for k, v in (("stopTime", stop), ("stepSize", step)) if v)
    return lambda xml: xml.replace(
        "<ModelVariables>", f"<DefaultExperiment{given}/><ModelVariables>"
    )


def oms(step: str) -> str:
    return (
        '<ssd:Annotations><ssc:Annotation type="org.openmodelica"><oms:FixedStepMaster '
        f'stepSize="{step}"/></ssc:Annotation></ssd:Annotations>'
    )


def test_times_that_the_package_leaves_open_are_those_of_its_fmus(tmp_path: Path) -> None:
    others = {
        f"{name}.fmu": build_stranger(2, tmp_path / name, experiment(*given))
        for name, given in {
            "a": ("2", "0.25"), "b": ("3", "0.5"), "c": ("", ""), "d": ("1", ""),
        }.items()
    }  # fmt: skip
    elements = "".join(component(n).replace("a%20b", n) for n in "abcd")
    path = package(tmp_path, others["a.fmu"], elements, after="", others=others)
    with opened(path) as found:
        plan = resolve(found.system)
    assert plan.stop_ns == 3_000_000_000
    assert plan.intervals_ns == {
        "a": 250_000_000, "b": 500_000_000, "c": 250_000_000, "d": 250_000_000,
    }  # fmt: skip
    assert found.remarks == (
        "stop time 3 s: the longest of the FMUs, as the package gives none",
        "communication intervals: the default step sizes of the FMUs, the smallest for those "
        "without one (a, c, d: 0.25 s; b: 0.5 s)",
    )


def test_one_interval_of_all_is_said_once(tmp_path: Path) -> None:
    fmu = build_stranger(2, tmp_path / "built", experiment("2", "0.25"))
    names = [f"c{i}" for i in range(20)]
    said = "communication intervals: the default step sizes of the FMUs"
    with opened(package(tmp_path, fmu, "".join(map(component, names)))) as found:
        assert found.remarks == (f"{said} (0.25 s)",)
    named = component("other").replace("a%20b", "other")
    other = build_stranger(2, tmp_path / "other", experiment("2", "0.5"))
    path = package(
        tmp_path, fmu, "".join(map(component, names)) + named, others={"other.fmu": other}
    )
    with opened(path) as found:
        listed = ", ".join(names[:8])
        assert found.remarks == (f"{said} ({listed} and 12 more: 0.25 s; other: 0.5 s)",)


def test_the_step_of_the_innermost_system_counts(tmp_path: Path) -> None:
    fmu = build_stranger(2, tmp_path / "built", experiment(step="0.125"))
    deep = inner("t", component("c"), after=oms("0.25"))
    elements = component("a") + inner("s", component("b") + deep)
    for outer, a in (("", 125_000_000), (oms("0.5"), 500_000_000)):
        path = package(tmp_path, fmu, elements, after=EXPERIMENT + outer)
        with opened(path) as found:
            intervals = resolve(found.system).intervals_ns
        assert intervals == {"a": a, "s/b": a, "s/t/c": 250_000_000}


@pytest.mark.parametrize("step", ["0", "-1", "nan", "1e-12", "x"])
def test_a_step_that_is_none_is_refused(step: str, stranger2: Path, tmp_path: Path) -> None:
    path = package(tmp_path, stranger2, component("a"), after=EXPERIMENT + oms(step))
    with pytest.raises(ConfigurationError, match=r"x\.ssp: stepSize: must be a"):
        settings(path)


# --- What is mended -------------------------------------------------------------------------------


def test_a_prefix_without_a_namespace_is_read(stranger2: Path, tmp_path: Path) -> None:
    alone = '<ssc:Annotation type="x.y"><?odd?><odd:thing odd:a="1"/></ssc:Annotation>'
    step = (
        '<ssc:Annotation type="com.opensimulationplatform"><osp:Algorithm><osp:FixedStepAlgorithm '
        'baseStepSize="0.5"/></osp:Algorithm></ssc:Annotation>'
    )
    after = f"{EXPERIMENT}<ssd:Annotations>{alone}{step}</ssd:Annotations>"
    path = package(tmp_path, stranger2, component("a"), after=after)
    text = zipfile.ZipFile(path).read("SystemStructure.ssd").decode()
    osp = f'xmlns:osp="{NAMESPACES["osp"]}"'
    assert osp in text
    others = {"a b.fmu": stranger2}

    def again(new: str) -> Path:
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("SystemStructure.ssd", new)
            for name, file in others.items():
                archive.writestr(f"resources/{name}", file.read_bytes())
        return path

    with opened(again(f"<?xml version='1.0'?>\n<!-- <a> -->\n{text.replace(osp, '')}")) as found:
        assert found.system.components["a"].interval_ns == 500_000_000
    assert found.remarks[0] == (
        "SystemStructure.ssd: read although the prefix 'odd' and 'osp' is bound to no namespace"
    )
    for wrong in (text.replace("<ssd:Annotations>", "<odd:x/><ssd:Annotations>"),
                  text.replace("<odd:thing", '<odd:thing odd:a="2"')):  # fmt: skip
        with pytest.raises(ConfigurationError, match=r"must be well-formed XML, got"):
            settings(again(wrong))


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("SSP1/SystemStructureParameterValues", "SSP1/ParameterValues"),
        ("http://ssp-standard.org/SSP1/SystemStructureParameterValues",
         "http://www.pmsf.net/xsd/SystemStructureParameterValuesDraft"),
        ("SSP1/SystemStructureParameterValues", "SSP2/SystemStructureParameterValues"),
    ],
)  # fmt: skip
def test_a_namespace_that_is_known_to_be_wrong_is_read(
    right: str, wrong: str, stranger2: Path, tmp_path: Path
) -> None:
    more = (
        f'<ssv:ParameterSet {SPACES} version="1.0" name="x"><ssv:Parameters>'
        '<ssv:Parameter name="gain"><ssv:Real value="4"/></ssv:Parameter>'
        "</ssv:Parameters></ssv:ParameterSet>"
    )
    assert right in more
    own = component("a", bound('<ssd:ParameterBinding source="resources/more.ssv"/>'))
    path = package(tmp_path, stranger2, own, more=more.replace(right, wrong))
    assert settings(path) == {"a.gain": (4.0,)}
    with opened(path) as found:
        assert "resources/more.ssv: the namespace http://" in found.remarks[0]
    path = package(tmp_path, stranger2, own, more=more.replace(right, "SSP1/Values"))
    with pytest.raises(ConfigurationError, match=r"must be a ParameterSet of SSP 1\.0 or 2\.0"):
        settings(path)


def test_what_is_in_another_namespace_is_not_passed_over(stranger2: Path, tmp_path: Path) -> None:
    path = package(
        tmp_path, stranger2, TWO, system="<osp:Connectors/>" + connectors("x input")
    )
    with pytest.raises(ConfigurationError, match="must have its Connectors in a namespace of SSP"):
        settings(path)


def test_the_record_says_how_many_instants(stranger2: Path, tmp_path: Path) -> None:
    result = sblcosim.run(package(tmp_path, stranger2, component("a")))
    assert result.text().startswith("x: 1001 instants, 0 to 1 s: a\n")


def test_a_record_without_receivers_is_told_by_its_last_values(
    stranger2: Path, tmp_path: Path
) -> None:
    own = bound(values(("gain", "Real", 'value="0.7"'), ("u[1]", "Real", 'value="1.1"'),
                       ("u[2]", "Real", 'value="-3"')))  # fmt: skip
    result = sblcosim.run(package(tmp_path, stranger2, component("a", own)))
    head, *rows = [re.split(r"\s{2,}", line.strip()) for line in result.text().splitlines()
                   if line.startswith(("output", "a."))]  # fmt: skip
    assert head == ["output", "at 1 s"]
    assert {name: value for name, value in rows if name.startswith("a.y")} == {
        "a.y[1,1]": "0.77", "a.y[1,2]": "1.1", "a.y[2,1]": "-2.1", "a.y[2,2]": "-3",
    }
    assert [name for name, _ in rows] == [*result.record.to_frame()][1:]
    assert result.answer == "x: 1001 instants, 0 to 1 s: a"


@pytest.mark.parametrize("command", ["plan", "run"])
def test_a_run_that_is_too_long_names_the_package(
    command: str, stranger2: Path, tmp_path: Path
) -> None:
    after = '<ssd:DefaultExperiment stopTime="1000000000"/>' + oms("0.0001")
    path = package(tmp_path, stranger2, component("a"), after=after)
    done = CliRunner().invoke(app, [command, str(path)])
    assert done.exit_code == 2
    assert done.stderr.startswith(f"error: {path}: record: must take at most ")


def test_a_missing_unit_is_warned_of_with_the_package(stranger2: Path, tmp_path: Path) -> None:
    nounit = component("a", "").replace("a%20b", "other")
    other = build_stranger(2, tmp_path / "other", lambda xml: xml.replace('"now" valueReference='
        '"600" causality="output" variability="discrete"><Real unit="s"/>', '"now" valueReference="'
        '600" causality="output" variability="discrete"><Real/>'))  # fmt: skip
    path = package(
        tmp_path, stranger2, nounit + component("b"), link("a.now", "b.u[1]"),
        others={"other.fmu": other},
    )  # fmt: skip
    with pytest.warns(ConfigurationWarning) as caught:
        sblcosim.run(path)
    assert str(caught[0].message) == (
        f"{path}: connection a.now -> b.u[1]: both ends must have the same unit, got none and m"
    )


def test_a_missing_unit_is_said_once_and_of_the_connection_that_lacks_it(tmp_path: Path) -> None:
    fmu = build_stranger(2, tmp_path / "built", lambda xml: xml.replace(
        'variability="discrete"><Real unit="s"/>', 'variability="discrete"><Real/>'))  # fmt: skip
    deep = inner("s", component("b"), link("b.u[1]", ".i") + link("b.u[2]", ".i"),
                 connectors("i input km"))  # fmt: skip
    for links in (link("a.now", "s.i"), link("s.i", "a.now")):  # whichever end is the start
        path = package(tmp_path, fmu, component("a") + deep, links)
        with pytest.warns(ConfigurationWarning) as caught, opened(path):
            pass
        assert [str(w.message) for w in caught] == [
            f"{path}: connection a.now -> s.i: both ends must have the same unit, got none and km"
        ]


# --- Drawings ----------------------------------------------------------------------------------


def nested(folder: Path, fmu: Path) -> Path:
    """a in km to s/b in m and back, and an input from outside."""
    deep = inner("s", component("b"), link(".i", "b.u[1]") + link("b.y[1,1]", ".o"),
                 connectors("i input m", "o output m"))  # fmt: skip
    links = link("a.now", "s.i") + link("s.o", "a.u[1]") + link(".x", "a.u[2]")
    return package(folder, fmu, component("a") + deep, links, connectors("x input km"))


def test_a_package_is_drawn_in_text(stranger2: Path, tmp_path: Path) -> None:
    path = str(nested(tmp_path, stranger2))
    short = CliRunner().invoke(app, ["plan", path]).stdout
    assert "× 1000" in short  # what changes values is on the first screen
    assert "s/b.u" not in short.partition("inputs without")[0]
    done = CliRunner().invoke(app, ["plan", path, "--verbose"])
    assert done.exit_code == 0, done.stderr
    text = done.stdout.partition("\nRun from 0 s to 1 s")[0]
    assert text.startswith("x: 2 components in 2 systems, 5 connections\n")
    rows = [line.split() for line in text.splitlines()]
    assert ["a", "a", "b.fmu", "2", "0.001", "s"] in rows
    assert ["s", "system"] in rows
    assert "  b      a b.fmu  2    0.001 s" in text
    assert ["a.now", "km", "s.i", "m", "×", "1000"] in rows
    assert ["from", "unit", "to", "unit", "values"] in rows
    assert ["x", "km", "a.u", "m", "×", "1000"] in rows
    assert ["s.i", "m", "s/b.u", "m"] in rows
    assert "inputs without a connection keep the value they begin with: a.n, a.on, s/b.u, s/b." \
        in text


def test_a_package_is_drawn_as_a_picture(stranger2: Path, tmp_path: Path) -> None:
    path, file = nested(tmp_path, stranger2), tmp_path / "x.svg"
    done = CliRunner().invoke(app, ["plan", str(path), "--svg", str(file)])
    assert done.exit_code == 0, done.stderr
    root = ElementTree.fromstring(file.read_text("utf-8"))
    space = "{http://www.w3.org/2000/svg}"
    texts = [element.text for element in root.iter(f"{space}text")]
    assert {"x", "a", "b", "s", "now [km]", "i [m]", "o [m]", "x [km]", "u [m]"} <= {*texts}
    assert texts.count("0.001 s, FMI 2, a b.fmu") == 2
    said = [title.text for title in root.iter(f"{space}title")]
    assert said[0] == "x"
    assert sorted(said[1:]) == [
        "a.now → s.i: × 1000", "s.b.y → s.o", "s.i → s.b.u", "s.o → a.u", "x → a.u: × 1000",
    ]  # fmt: skip
    (look,) = root.iter(f"{space}style")
    assert "prefers-color-scheme:dark" in str(look.text)
    width, height = (float(root.get(side, "")) for side in ("width", "height"))
    for element in root.iter():
        low = float(element.get("y", "0")) + float(element.get("height", "0"))
        assert element is root or 0 <= low <= height
    ways = " ".join(str(way.get("d")) for way in root.iter(f"{space}path"))
    numbers = re.findall(r"[-\d.]+", ways)
    assert len(numbers) > 2 * len(said[1:])  # a connection has two ends at least
    for number in numbers:
        assert -width / 4 <= float(number) <= max(width, height)  # within the texts of connectors


def crowded(folder: Path, fmu: Path) -> Path:
    """As `nested`, with two rows of connectors and two ways back."""
    deep = inner(
        "s", component("b"),
        link(".i", "b.u[1]") + link(".longer_name", "b.gain") + link("b.y[1,1]", ".o")
        + link("b.steps", ".further"),
        connectors("i input m", "longer_name parameter", "o output m", "further output"),
    )  # fmt: skip
    links = link("a.now", "s.i") + link("s.o", "a.u[1]") + link("s.further", "a.n")
    links += link(".x", "a.u[2]")
    return package(folder, fmu, component("a") + deep, links, connectors("x input km"))


def test_boxes_ways_and_texts_of_a_picture_are_where_they_belong(
    stranger2: Path, tmp_path: Path
) -> None:
    """By hand: a letter is 6.2 wide, a row 17 high; a head has 40, and a frame 12 around its texts.

    Columns are 64 apart, and ways back 9. The note of an FMU, 23 letters, makes its box 142.6 + 24
    wide. Columns are centred.
    """
    with opened(crowded(tmp_path, stranger2)) as found:
        root = ElementTree.fromstring(svg(found, resolve(found.system)))
    space = "{http://www.w3.org/2000/svg}"
    assert (root.get("width"), root.get("height"), root.get("viewBox")) == (
        "914", "293", "0 0 914 293"
    )
    boxes, places, inside = {}, {}, {}
    for group in root.iter(f"{space}g"):
        frame = group.find(f"{space}rect")
        if frame is None:
            continue
        name = str(group.findtext(f"{space}text"))
        boxes[name] = (group.get("transform"), frame.get("class"), frame.get("width"),
                       frame.get("height"))  # fmt: skip
        places[name] = [tuple(map(float, (e.get("x", ""), e.get("y", ""))))
                        for e in group.findall(f"{space}text")]  # fmt: skip
        inside[name] = [e.get("transform") for e in group.findall(f"{space}g")]
    assert boxes == {
        "x": ("translate(8.0 8.0)", "system", "898.0", "226.0"),
        "a": ("translate(64.0 26.0)", "part", "166.6", "86.0"),
        "s": ("translate(294.6 0.0)", "system", "454.2", "138.0"),
        "b": ("translate(64.0 0.0)", "part", "166.6", "86.0"),
    }
    assert inside["x"] == ["translate(61.2 40.0)"]  # beside the six letters of x [km]
    assert inside["s"] == ["translate(92.2 40.0)"]
    assert places["a"] == [(12, 17), (12, 32), (7, 52.5), (7, 69.5), (159.6, 52.5)]
    assert places["s"] == [(12, 17), (7, 52.5), (7, 69.5), (447.2, 52.5), (447.2, 69.5)]
    assert {
        way.findtext(f"{space}title"): (way.get("class"), way.get("d"))
        for way in root.iter(f"{space}path")
    } == {
        "a.now → s.i: × 1000":
            ("c1", "M230.6 74.5H230.6C262.6 74.5 262.6 48.5 294.6 48.5"),
        "x → a.u: × 1000": ("c0", "M-12.0 8.5H0.0C32.0 8.5 32.0 74.5 64.0 74.5"),
        "s.o → a.u": ("c2", "M748.8 48.5H756.8V169.5H56.0V74.5H64.0"),
        "s.further → a.n": ("c2", "M748.8 65.5H761.8V160.5H51.0V91.5H64.0"),
        "s.i → s.b.u": ("c2", "M-49.2 8.5H0.0C32.0 8.5 32.0 48.5 64.0 48.5"),
        "s.longer_name → s.b.gain": ("c2", "M-12.0 25.5H0.0C32.0 25.5 32.0 65.5 64.0 65.5"),
        "s.b.y → s.o": ("c3", "M230.6 48.5H230.6C265.6 48.5 265.6 8.5 300.6 8.5H319.0"),
        "s.b.steps → s.further":
            ("c3", "M230.6 65.5H230.6C265.6 65.5 265.6 25.5 300.6 25.5H306.6"),
    }  # fmt: skip
    assert [e.get("y") for e in root.findall(f"{space}text")] == ["251.0", "268.0", "285.0"]
    assert [e.get("stroke-dasharray") for e in root.iter(f"{space}path")].count("6 3") == 2


def test_names_of_elements_make_their_boxes_wide(stranger2: Path, tmp_path: Path) -> None:
    """Titles are a seventh larger than other texts, and are cut at 36 letters."""
    for letters, shown in ((20, 20), (30, 30), (36, 36), (40, 36)):
        width = max(142.6, shown * 6.2 * 1.15) + 24
        path = package(tmp_path, stranger2, component("n" * letters))
        with opened(path) as found:
            text = svg(found, resolve(found.system))
        assert f'<rect class="part" width="{width:.1f}" height="52.0"' in text
        assert (f">{'n' * 36}</text>" in text) == (letters == 36)
        assert ("n" * 35 + "…<title>" + "n" * 40 in text) == (letters == 40)


def test_six_connections_that_change_values_are_on_the_first_screen(
    stranger2: Path, tmp_path: Path
) -> None:
    """Those of the elements of an array count as one there, and as two above."""
    for boxes, more in (("bcdefg", ""), ("bcdefghi", "and 2 more that change values")):
        links = "".join(link("a.now", f"{box}.u[{i}]") for box in boxes for i in (1, 2))
        path = package(tmp_path, stranger2, "".join(map(component, "a" + boxes)), links)
        said = CliRunner().invoke(app, ["plan", str(path)]).stdout
        lines = said.splitlines()
        assert lines[0] == (
            f"x: {len(boxes) + 1} components, {2 * len(boxes)} connections"
        )
        assert [line for line in lines if "× 1000" in line] == [
            f"a.now (2)  km    {box}.u  m     × 1000" for box in boxes[:6]
        ]
        assert [line for line in lines if "more that" in line] == ([more] if more else [])
        whole = CliRunner().invoke(app, ["plan", str(path), "--verbose"]).stdout
        assert whole.count("a.now (2)") == len(boxes)
        assert "more that" not in whole


def test_a_picture_explains_its_marks_and_keeps_long_names(
    stranger2: Path, tmp_path: Path
) -> None:
    def drawn(path: Path) -> tuple[list[str], list[str]]:
        with opened(path) as found:
            root = ElementTree.fromstring(svg(found, resolve(found.system)))
        said = [*root.iter("{http://www.w3.org/2000/svg}text")]
        widest = max(
            float(e.get("width", "0")) for e in root.iter("{http://www.w3.org/2000/svg}rect")
        )
        titles = [str(e.text) for e in said if e.get("class") == "title"]
        assert widest > 6 * max(map(len, titles))
        return [str(e.text) for e in said], [str(child.text) for e in said for child in e]

    texts, _ = drawn(nested(tmp_path, stranger2))
    assert texts[-3:] == [
        "Colour: that of the element that gives the value",
        "Dashed: values are changed, or units differ", "Dotted frame: a system",
    ]  # fmt: skip
    name = "a name of many letters & more than forty"
    path = package(tmp_path, stranger2, component(name.replace("&", "&amp;")))
    texts, whole = drawn(path)
    assert name[:35] + "…" in texts
    assert whole == [name]
    assert not any(text.startswith(("Colour", "Dashed", "Dotted")) for text in texts)


def test_boxes_hold_all_their_connectors(stranger2: Path, tmp_path: Path) -> None:
    ways = ("now", "u[1]"), ("y[1,1]", "u[2]"), ("steps", "n"), ("was_on", "on")
    links = "".join(link(f"a.{start}", f"{box}.{end}") for box in "bc" for start, end in ways)
    path = package(tmp_path, stranger2, "".join(map(component, "abc")), links)
    with opened(path) as found:
        root = ElementTree.fromstring(svg(found, resolve(found.system)))
    space, dots = "{http://www.w3.org/2000/svg}", 0
    boxes: dict[str, tuple[float, float]] = {}
    for group in root.iter(f"{space}g"):
        frame = group.find(f"{space}rect")
        if frame is not None:
            top = float(str(group.get("transform")).rstrip(")").split()[1])
            height = float(frame.get("height", "0"))
            boxes[str(group.findtext(f"{space}text"))] = top, top + height
            for dot in group.findall(f"{space}circle"):
                assert 0 < float(dot.get("cy", "nan")) < height
                dots += 1
    assert dots == 4 + 3 + 3  # the elements of u are one
    above, below = sorted(boxes[name] for name in "bc")
    assert above[1] < below[0]


def test_what_leaves_a_package_in_a_wrong_unit_is_drawn(stranger2: Path, tmp_path: Path) -> None:
    path = package(
        tmp_path, stranger2, component("a"), link("a.now", ".x"), connectors("x output kg")
    )
    done = CliRunner().invoke(app, ["plan", str(path)])
    assert done.exit_code == 0, done.stderr
    assert "a.now  km    x   kg    cannot be converted" in done.stdout


def test_circles_and_long_ways_are_drawn(stranger2: Path, tmp_path: Path) -> None:
    names = [chr(ord("a") + i) for i in range(12)]
    random = np.random.default_rng(1)
    links = "".join(
        link(f"{names[i]}.y[1,1]", f"{names[j]}.u[{k + 1}]")
        for j in range(12) for k, i in enumerate(random.integers(0, 12, 2))
    )  # fmt: skip
    path = package(tmp_path, stranger2, "".join(map(component, names)), links)
    with opened(path) as found:
        text = svg(found, resolve(found.system))
    root = ElementTree.fromstring(text)
    paths = [*root.iter("{http://www.w3.org/2000/svg}path")]
    assert len(paths) == len(lines_of(found))
    assert "nan" not in text
    as_recorded.check("picture of a package", {"svg": text.splitlines()})


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["x.ssp", "--svg", "x.ssp"], "error: x.ssp: must be an SVG file, FILE.svg, got x.ssp"),
        (["x.ssp", "--svg", "x.ssp/x.svg"], "error: x.ssp/x.svg: must be writable, got "),
        (["paper-scenario-1", "--svg", "x.svg"], "error: --svg: must come with an SSP package"),
    ],
)
def test_a_picture_that_cannot_be_written_is_refused(
    arguments: list[str], message: str, stranger2: Path, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    before = nested(tmp_path, stranger2).read_bytes()
    done = CliRunner().invoke(app, ["plan", *arguments])
    assert done.exit_code == 2
    assert done.stderr.startswith(message)
    assert (tmp_path / "x.ssp").read_bytes() == before


# --- What is refused ------------------------------------------------------------------------------

A = component("a")
TWO = A + component("b")
ODD: dict[str, tuple[dict[str, str], str]] = {
    "a dictionary": (
        {"elements": '<ssd:SignalDictionaryReference name="d" dictionary="x"/>'},
        r"elements of the system must be components or systems, got SignalDictionaryReference 'd'",
    ),
    "a dictionary of the system": (
        {"elements": A, "system": "<ssd:SignalDictionaries/>"},
        r"the system: must hold what can be simulated here, got SignalDictionaries",
    ),
    "only an empty system": (
        {"elements": '<ssd:System name="inner"/>'}, r"must have at least one component, got none",
    ),
    "Model Exchange": (
        {"elements": component("a", more='implementation="ModelExchange"')},
        r"Component 'a': implementation must be CoSimulation, got ModelExchange",
    ),
    "a package in the package": (
        {"elements": component("a", more='type="application/x-ssp-package"')},
        r"Component 'a': type must be application/x-fmu-sharedlibrary, got application/x-ssp-pack",
    ),
    "a file that is not there": (
        {"elements": A.replace("a%20b", "a%20c")},
        r"Component 'a': source must be a file in the package, got '.*'; did you mean 'resources/a",
    ),
    "a file elsewhere": (
        {"elements": A.replace("resources/a%20b", "../../../etc/passwd")},
        r"source must be a file in the package",
    ),
    "twice the same name": ({"elements": A + A}, r"names of components must be unique, got a"),
    "no component": ({"elements": ""}, r"must have at least one component, got none"),
    "an unknown element": (
        {"elements": TWO, "links": link("c.now", "b.u[1]")},
        r"startElement must be a component or system, got 'c'",
    ),
    "an unknown connector": (
        {"elements": TWO, "links": link("a.nwo", "b.u[1]")},
        r"connection a\.nwo -> b\.u\[1\]: must be .* got 'nwo' of a; did you mean 'now'\?",
    ),
    "another transformation": (
        {"elements": TWO, "links": link("a.now", "b.u[1]", "<ssc:BooleanMappingTransformation/>")},
        r"must hold what can be simulated here, got BooleanMappingTransformation",
    ),
    "different quantities": (
        {"elements": component("a", '<ssd:Connectors><ssd:Connector name="now" kind="output">'
         '<ssc:Real unit="kg"/></ssd:Connector></ssd:Connectors>') + component("b"),
         "links": link("a.now", "b.u[1]")},
        r"must have units of the same quantity at both ends, got 'kg' and 'm'",
    ),
    "a mapping of nothing": (
        {"elements": component("a", bound("<ssd:ParameterBinding><ssd:ParameterMapping/>"
                                          "</ssd:ParameterBinding>"))},
        r"ParameterBinding: must have a source or a ParameterSet in its ParameterValues, got nei",
    ),
    "parameters of another kind": (
        {"elements": component("a", bound('<ssd:ParameterBinding type="text/csv"/>'))},
        r"type must be application/x-ssp-parameter-set, got text/csv",
    ),
    "parameters in the FMU": (
        {"elements": component("a", bound('<ssd:ParameterBinding sourceBase="component"/>'))},
        r"sourceBase must be SSD, got component",
    ),
    "no number": (
        {"elements": component("a", bound(values(("gain", "Real", 'value="two"'))))},
        r"a\.gain: must be a number, got 'two'",
    ),
    "a unit that nobody knows": (
        {"elements": component("a", bound(values(("gain", "Real", 'value="1" unit="kmm"'))))},
        r"must have a unit that is defined, got 'kmm'; did you mean 'km'\?",
    ),
    "a value in another quantity": (
        {"elements": component("a", bound(values(("offset[1]", "Real", 'value="1" unit="kg"'))))},
        r"a\.offset\[1\]: must be given in a unit that can become m, got one of another .*, 'kg'$",
    ),
    "an output that is set": (
        {"elements": component("a", bound(values(("now", "Real", 'value="1"'))))},
        r"a\.now: must be a parameter or an input to be set, got one of causality output",
    ),
    "no stop time": ({"elements": A, "after": ""}, r"DefaultExperiment: must have a stopTime"),
    "a time that is none": (
        {"elements": A, "after": '<ssd:DefaultExperiment stopTime="nan"/>'},
        r"stopTime: must be a finite number, got 'nan'",
    ),
    "a time that ticks cannot count": (
        {"elements": A, "after": '<ssd:DefaultExperiment stopTime="4000000000"/>'},
        r"stopTime: must be less than 4e\+09 s, got 4000000000$",
    ),
    "another version": ({"elements": A, "version": "3.0"}, r"must be of version 1\.0 or 2\.0, got"),
    "an unknown kind of connection": (
        {"elements": TWO, "links": "<ssd:Bus/>"}, r"the system: must have connections, got Bus",
    ),
    "an unknown binding": (
        {"elements": component("a", bound("<ssd:Odd/>"))},
        r"Component 'a': must have bindings of parameters, got Odd",
    ),
    "something beside the system": (
        {"elements": A, "after": EXPERIMENT + "<ssd:Variants/>"},
        r"SystemStructure\.ssd: must hold what can be simulated here, got Variants",
    ),
    "no version": ({"elements": A, "version": ""}, r"must be of version 1\.0 or 2\.0, got ''"),
}


@pytest.mark.parametrize("what", ODD)
def test_what_is_not_understood_is_refused_by_name(
    what: str, stranger2: Path, tmp_path: Path
) -> None:
    given, message = ODD[what]
    path = package(tmp_path, stranger2, **given)
    with pytest.raises(ConfigurationError, match=message) as caught:
        sblcosim.run(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert len(str(caught.value).splitlines()) == 1


def written(path: Path, xml: str | bytes, name: str = "SystemStructure.ssd") -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(name, xml)
    return path


BOMB = '<!DOCTYPE a [<!ENTITY b "ha">]><a>&b;</a>'


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda p: p, r"must be an SSP package, got no file"),
        (lambda p: p.mkdir() or p, r"must be an SSP package, got a folder"),
        (lambda p: p.write_bytes(b"PK\3\4nothing") and p, r"is not an SSP package"),
        (lambda p: written(p, "<a>"), r"SystemStructure\.ssd must be well-formed XML"),
        (lambda p: written(p, "<b:a/>"), r"must be well-formed XML, got unbound prefix"),
        (lambda p: written(p, BOMB), r"must be XML without a document type declaration"),
        (lambda p: written(p, "<a/>"), r"must be a SystemStructureDescription of SSP 1\.0 or 2\.0"),
        (lambda p: written(p, "<a/>", "a.ssd"), r"must contain SystemStructure\.ssd, got none"),
        (lambda p: written(p, "<a/>", "../a"), r"must hold names of files inside its folder"),
        (lambda p: written(p, "<x>" * 200), r"nested at most 100 elements deep"),
    ],
)
def test_a_damaged_package_is_refused_in_a_line(
    make: Callable[[Path], Path], message: str, tmp_path: Path
) -> None:
    path = make(tmp_path / "x.ssp")
    with pytest.raises(ConfigurationError, match=message) as caught:
        sblcosim.run(path)
    assert len(str(caught.value).splitlines()) == 1


def test_a_byte_that_is_wrong_gives_a_line_or_a_system(stranger2: Path, tmp_path: Path) -> None:
    path = package(tmp_path, stranger2, TWO, link("a.now", "b.u[1]"))
    content = path.read_bytes()
    random = np.random.default_rng(7)
    said = set()
    for place in random.integers(0, len(content), 40):
        damaged = bytearray(content)
        damaged[place] ^= 1 << int(random.integers(8))
        path.write_bytes(damaged)
        try:
            with opened(path) as found:
                resolve(found.system)
        except ConfigurationError as error:
            said.add(str(error))
    assert said
    assert all(len(message.splitlines()) == 1 for message in said)
