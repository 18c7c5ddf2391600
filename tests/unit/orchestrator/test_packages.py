"""SSP packages, ours and those of others, are run as the systems that they describe."""

from __future__ import annotations

import json
import math
import re
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sblcosim
from sblcosim.cli import app
from sblcosim.errors import ConfigurationError, ConfigurationWarning, FmuError
from sblcosim.export.ssp import export_ssp
from sblcosim.fmus.build.factory import build
from sblcosim.fmus.files import scratch
from sblcosim.packages.read import opened
from sblcosim.packages.structure import NAMESPACES
from sblcosim.packages.units import conversion, unit_of
from sblcosim.results import metrics
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.execution import execute
from sblcosim.simulation.record import Record
from sblcosim.simulation.resolve import resolve
from sblcosim.simulation.system import Conversion
from stranger import build_stranger
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
    tracks = {name: metrics.track(expected, name) for name in result.receivers}
    assert result.errors.equals(metrics.error_table(tracks))


@pytest.mark.parametrize("master", ["native", "python", "lanes"])
def test_a_receiver_that_is_updated_less_often_comes_back(master: str, tmp_path: Path) -> None:
    file = export_ssp(DIVE, tmp_path / "x.ssp", ("ekf", "sequential"))
    result = sblcosim.run(str(file), master=master)
    same(result.record, execute(resolve(connect(sblcosim.load(DIVE), ("ekf", "sequential")))))
    assert result.record.intervals_ns["ekf"] == 2 * result.record.intervals_ns["target"]
    assert result.receivers == ("ekf", "sequential")
    assert result.update_interval_ns == 200_000_000


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
    assert done.exit_code == 0, done.stderr
    assert "ekf        ekf.fmu        2" in done.stdout
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
    **files: str,
) -> Path:
    """Write a package with one FMU; `system` goes before the elements."""
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


def test_a_parameter_of_nothing_is_warned_of(stranger2: Path, tmp_path: Path) -> None:
    path = package(
        tmp_path, stranger2, component("a", bound(values(("gian", "Real", 'value="1"'))))
    )
    with pytest.warns(ConfigurationWarning, match=r"a: parameter 'gian' has no effect.*'gain'\?"):
        assert settings(path) == {}


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
        r"a\.offset\[1\]: must be given in a unit that can become m, got one of another quantity",
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
