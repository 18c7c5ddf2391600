"""What is in an exported package, and what cannot be exported."""

from __future__ import annotations

import importlib.util
import json
import re
import zipfile
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

import fmpy
import pytest
import sblcosim
from fmpy.validation import validate_fmu
from lxml import etree
from sblcosim.cli import app
from sblcosim.errors import ConfigurationError
from sblcosim.export.container import export_fmu
from sblcosim.export.ssp import PARAMETER_SET, export_ssp
from sblcosim.fmus.host.nanoseconds import SECOND
from sblcosim.models import COMPONENTS
from sblcosim.models.ports import ESTIMATE, REQUIRED_ESTIMATE
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.masters.python import execute
from sblcosim.simulation.resolve import resolve
from sblcosim.simulation.system import ComponentSpec, Connection, System
from seams import Seam
from typer.testing import CliRunner

SCENARIO: dict[str, Any] = {
    "name": "dive",
    "title": "A dive",
    "time": {"sampling_time_s": 0.1, "ekf_ratio": 2, "duration_s": 10.0},
    "platform": {"arm_length_m": 0.7},
    "receiver": {"type": "ekf", "prior": "true"},
}
SCHEMAS = {
    1: files("fmpy.ssp") / "schema",
    2: files("pyssp_standard") / "resources" / "ssp2",
}
KINDS = {
    ".ssd": "SystemStructureDescription.xsd",
    ".ssv": "SystemStructureParameterValues.xsd",
}
NS = {
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
    "osp": "http://opensimulationplatform.com/SSP/OSPAnnotations",
    "oms": "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd",
    "own": "urn:org.sblcosim",
}
CONVERSIONS = {"Integer": int, "Int32": int, "Boolean": "true".__eq__}
BOOLEANS = {"true": "1", "false": "0"}
STRANGER = Path(__file__).parents[3] / "examples" / "receiver_in_c"


class Mirror:
    """A receiver in Python."""

    variables = tuple(v for v in ESTIMATE if v.name in REQUIRED_ESTIMATE)

    def initialise(self, start_ns: int, parameters: Any) -> Any:
        raise NotImplementedError

    def do_step(self, time_ns: int, step_ns: int, inputs: Any) -> Any:
        raise NotImplementedError


@pytest.fixture(scope="module", params=[1, 2], ids=["SSP 1.0", "SSP 2.0"])
def version(request: pytest.FixtureRequest) -> int:
    return request.param


@pytest.fixture(scope="module")
def package(version: int, tmp_path_factory: pytest.TempPathFactory) -> zipfile.ZipFile:
    path = tmp_path_factory.mktemp("ssp") / "dive.ssp"
    return zipfile.ZipFile(export_ssp(SCENARIO, path, ("ekf", "sequential"), version=version))


@pytest.fixture(scope="module")
def structure(package: zipfile.ZipFile) -> etree._Element:
    return etree.fromstring(package.read("SystemStructure.ssd"))


@pytest.fixture(scope="module")
def receiver(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Somebody else's receiver, with changes to its model description."""
    spec = importlib.util.spec_from_file_location("build", STRANGER / "build.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    original = tmp_path_factory.mktemp("original") / "receiver.fmu"
    module.build(original)

    def edited(*changes: tuple[str, str]) -> Path:
        path = tmp_path_factory.mktemp("edited") / "receiver.fmu"
        with zipfile.ZipFile(original) as old, zipfile.ZipFile(path, "w") as new:
            for name in old.namelist():
                content = old.read(name)
                for before, after in changes if name == "modelDescription.xml" else ():
                    assert before.encode() in content
                    content = content.replace(before.encode(), after.encode())
                new.writestr(name, content)
        return path

    return edited


def described(package: zipfile.ZipFile, name: str) -> etree._Element:
    with package.open(f"resources/{name}.fmu") as file, zipfile.ZipFile(file) as fmu:
        return etree.fromstring(fmu.read("modelDescription.xml"))


def test_all_files_are_valid(package: zipfile.ZipFile, version: int) -> None:
    checked = 0
    for name in package.namelist():
        if Path(name).suffix in KINDS:
            schema = etree.XMLSchema(file=str(SCHEMAS[version] / KINDS[Path(name).suffix]))
            schema.assertValid(etree.fromstring(package.read(name)))
            checked += 1
    assert checked == 6


def test_all_fmus_are_inside_and_of_the_version(
    package: zipfile.ZipFile, structure: etree._Element, version: int
) -> None:
    sources = [c.get("source") for c in structure.iterfind(".//ssd:Component", NS)]
    assert sources == [
        f"resources/{name}.fmu"
        for name in ("target", "platform", "acoustics", "ekf", "sequential")
    ]
    for source in sources:
        description = described(package, Path(source).stem)
        assert description.get("fmiVersion") == f"{version + 1}.0"


def test_connections_are_those_of_the_plan_and_between_components_only(
    structure: etree._Element, version: int
) -> None:
    assert structure.find("ssd:System/ssd:Connectors", NS) is None
    found = {
        tuple(c.get(k) for k in ("startElement", "startConnector", "endElement", "endConnector"))
        for c in structure.iterfind(".//ssd:Connection", NS)
    }
    fmi = version + 1
    plan = resolve(connect(sblcosim.load(SCENARIO), ("ekf", "sequential"), fmi=fmi))
    expected = set()
    for component in plan.components:
        if component.name == "raw":
            continue
        for write in component.writes:
            for connection in write.connections:
                source, output = connection.source.split(".")
                target, input_ = connection.target.split(".")
                outputs, inputs = COMPONENTS[source][output], COMPONENTS[target][input_]
                if version == 2:
                    expected.add((source, output, target, input_))
                else:
                    pairs = zip(outputs.elements, inputs.elements, strict=True)
                    expected |= {(source, a, target, b) for a, b in pairs}
    assert found == expected
    connectors = {
        (component.get("name"), connector.get("name"), connector.get("kind"))
        for component in structure.iterfind(".//ssd:Component", NS)
        for connector in component.iterfind("ssd:Connectors/ssd:Connector", NS)
    }
    for source, output, target, input_ in found:
        assert (source, output, "output") in connectors
        assert (target, input_, "input") in connectors


def test_connectors_have_the_types_units_and_shapes_of_the_fmus(
    package: zipfile.ZipFile, structure: etree._Element, version: int
) -> None:
    component = structure.find(".//ssd:Component[@name='acoustics']", NS)
    for variable in COMPONENTS["acoustics"]:
        if variable.causality == "parameter":
            continue
        names = variable.elements if version == 1 else (variable.name,)
        for name in names:
            connector = component.find(f"ssd:Connectors/ssd:Connector[@name='{name}']", NS)
            kind = connector[0]
            types = {"Float64": "Real", "Int32": "Integer"} if version == 1 else {}
            assert kind.tag == f"{{{NS['ssc']}}}{types.get(variable.type, variable.type)}"
            assert kind.get("unit") == variable.unit
            sizes = [int(d.get("size")) for d in connector.iterfind("ssc:Dimension", NS)]
            assert sizes == (list(variable.shape) if version == 2 else [])


def test_units_are_defined_as_in_the_fmus(
    package: zipfile.ZipFile, structure: etree._Element, version: int
) -> None:
    units = {u.get("name"): dict(u[0].attrib) for u in structure.iterfind("ssd:Units/ssc:Unit", NS)}
    expected = {}
    for source in structure.iterfind(".//ssd:Component", NS):
        for unit in described(package, source.get("name")).iter("Unit"):
            expected[unit.get("name")] = dict(unit[0].attrib)
    assert units == expected
    assert units["m2/s3"] == {"m": "2", "s": "-3"}
    assert units["rad/K"] == {"rad": "1", "K": "-1"}
    assert units["s/s"] == {}


def test_every_component_has_its_parameters_by_their_short_names(
    package: zipfile.ZipFile, structure: etree._Element, version: int
) -> None:
    system = connect(sblcosim.load(SCENARIO), ("ekf", "sequential"))
    for component in structure.iterfind(".//ssd:Component", NS):
        (binding,) = component.iterfind("ssd:ParameterBindings/ssd:ParameterBinding", NS)
        values = etree.fromstring(package.read(binding.get("source")))
        assert values.get("name") == PARAMETER_SET
        found = {
            p.get("name"): p[0].get("value") for p in values.iterfind(".//ssv:Parameter", NS)
        }
        name = component.get("name")
        expected = {}
        for key, value in system.components[name].parameters.items():
            variable = COMPONENTS[name][key]
            if not variable.shape:
                expected[key] = value
            elif version == 2:
                expected[key] = list(value)
            else:
                expected |= dict(zip(variable.elements, value, strict=True))
        assert found.keys() == expected.keys()
        for key, value in expected.items():
            numbers = [float(BOOLEANS.get(word, word)) for word in found[key].split()]
            assert numbers == (value if isinstance(value, list) else [value]), key


def test_the_package_is_the_whole_system(
    package: zipfile.ZipFile, structure: etree._Element, version: int, tmp_path: Path
) -> None:
    """Read back, it gives the same record to the last bit."""
    package.extractall(tmp_path)
    components = {}
    intervals = intervals_of(structure)
    for component in structure.iterfind(".//ssd:Component", NS):
        name = component.get("name")
        parameters: dict[str, list[float]] = {}
        values = etree.fromstring(package.read(f"resources/{name}.ssv"))
        for parameter in values.iterfind(".//ssv:Parameter", NS):
            convert = CONVERSIONS.get(etree.QName(parameter[0]).localname, float)
            numbers = [convert(word) for word in parameter[0].get("value").split()]
            parameters.setdefault(parameter.get("name").partition("[")[0], []).extend(numbers)
        components[name] = ComponentSpec(
            tmp_path / component.get("source"),
            round(float(intervals[name]) * SECOND),
            {
                key: numbers if COMPONENTS[name][key].shape else numbers[0]
                for key, numbers in parameters.items()
            },
        )
    ends = {
        tuple(
            f"{c.get(f'{end}Element')}.{c.get(f'{end}Connector').partition('[')[0]}"
            for end in ("start", "end")
        )
        for c in structure.iterfind(".//ssd:Connection", NS)
    }
    stop = float(structure.find("ssd:DefaultExperiment", NS).get("stopTime"))
    connections = tuple(Connection(*pair) for pair in sorted(ends))
    system = System(components, connections, round(stop * SECOND))
    record = execute(resolve(system))
    original = connect(sblcosim.load(SCENARIO), ("ekf", "sequential"), fmi=version + 1)
    expected = execute(resolve(original))
    assert len(record) == len(expected) > 50
    for key, value in record.values.items():
        assert value.tobytes() == expected.values[key].tobytes(), key


def test_the_true_prior_is_a_number(package: zipfile.ZipFile, version: int) -> None:
    values = etree.fromstring(package.read("resources/ekf.ssv"))
    found = {p.get("name"): p[0].get("value") for p in values.iterfind(".//ssv:Parameter", NS)}
    start = sblcosim.run(SCENARIO).table.iloc[0]
    true = [start[f"target.position[{i}]"] for i in (1, 2, 3)]
    names = ["prior_position"] if version == 2 else [f"prior_position[{i}]" for i in (1, 2, 3)]
    assert [float(word) for name in names for word in found[name].split()] == true
    assert any(true)


def intervals_of(structure: etree._Element) -> dict[str, str]:
    (group,) = structure.iterfind(
        "ssd:System/ssd:Annotations/ssc:Annotation[@type='org.sblcosim']/own:Intervals", NS
    )
    return {i.get("component"): i.get("seconds") for i in group}


def test_step_sizes_are_annotated_for_osp_and_omsimulator(structure: etree._Element) -> None:
    assert intervals_of(structure) == {
        "target": "0.1", "platform": "0.1", "acoustics": "0.1", "ekf": "0.2", "sequential": "0.2",
    }  # fmt: skip
    experiment = structure.find("ssd:DefaultExperiment", NS)
    assert (experiment.get("startTime"), experiment.get("stopTime")) == ("0.0", "10.0")
    algorithm = experiment.find(
        "ssd:Annotations/ssc:Annotation[@type='com.opensimulationplatform']/osp:Algorithm/"
        "osp:FixedStepAlgorithm",
        NS,
    )
    assert algorithm.get("baseStepSize") == "0.1"
    master = structure.find(
        "ssd:System/ssd:Annotations/ssc:Annotation[@type='org.openmodelica']/oms:Annotations/"
        "oms:SimulationInformation/oms:FixedStepMaster",
        NS,
    )
    assert master.get("stepSize") == "0.1"
    # OMSimulator reads the first annotation of a system only, and accepts none of a component.
    assert structure.find("ssd:System/ssd:Annotations/ssc:Annotation", NS).get("type") == (
        "org.openmodelica"
    )
    assert structure.find(".//ssd:Component/ssd:Annotations", NS) is None


def test_names_are_identifiers(version: int, tmp_path: Path) -> None:
    """OMSimulator takes no others; they tell the components apart all the same."""
    labels = {"my-ekf": "ekf", "my_ekf": "ekf", "2nd": "sequential", "ü": "ekf"}
    scenario = {**SCENARIO, "name": "1-dive, ü"}
    path = export_ssp(scenario, tmp_path / "x.ssp", labels, version=version)
    package = zipfile.ZipFile(path)
    structure = etree.fromstring(package.read("SystemStructure.ssd"))
    assert structure.get("name") == "x1_dive___"
    assert structure.find("ssd:System", NS).get("name") == "system"
    names = [c.get("name") for c in structure.iterfind(".//ssd:Component", NS)]
    assert names == [
        "target", "platform", "acoustics", "my_ekf_2", "my_ekf", "x2nd", "x_",
    ]  # fmt: skip
    assert intervals_of(structure).keys() == set(names)
    for connection in structure.iterfind(".//ssd:Connection", NS):
        assert {connection.get("startElement"), connection.get("endElement")} <= set(names)
    ends = {c.get("endElement") for c in structure.iterfind(".//ssd:Connection", NS)}
    assert ends == set(names) - {"target", "platform"}
    for name in names:
        assert f"resources/{name}.ssv" in package.namelist()
        sequential = described(package, name).get("modelName") == "Sequential"
        assert sequential == (name == "x2nd")


@pytest.mark.slow
def test_steps_are_the_longest_that_divide_all_intervals(tmp_path: Path) -> None:
    scenario = {
        **SCENARIO,
        "time": {"sampling_time_s": 0.6, "duration_s": 6.0},
        "target": {"interval_s": 0.2},
        "platform": {"interval_s": 0.3},
    }
    with zipfile.ZipFile(export_ssp(scenario, tmp_path / "x.ssp", bake=True)) as package:
        structure = etree.fromstring(package.read("SystemStructure.ssd"))
        steps = {described(package, name).find("DefaultExperiment").get("stepSize")
                 for name in ("target", "platform", "acoustics", "ekf")}
    found = structure.xpath("//@*[local-name() = 'stepSize' or local-name() = 'baseStepSize']")
    assert {*found, *steps} == {"0.1"}
    single = fmpy.read_model_description(str(export_fmu(scenario, tmp_path / "x.fmu")))
    assert float(single.defaultExperiment.stepSize) == 0.1


def test_equal_scenarios_give_equal_bytes(tmp_path: Path) -> None:
    one, other = (export_ssp(SCENARIO, tmp_path / f"{n}.ssp").read_bytes() for n in (1, 2))
    assert one == other


def test_baked_fmus_start_with_the_scenarios_numbers(version: int, tmp_path: Path) -> None:
    path = export_ssp(SCENARIO, tmp_path / "x.ssp", version=version, bake=True)
    description = described(zipfile.ZipFile(path), "platform")
    (variable,) = description.xpath("//*[@name='arm_length']")
    assert (variable[0] if version == 1 else variable).get("start") == "0.7"
    experiment = description.find("DefaultExperiment")
    assert (experiment.get("stopTime"), experiment.get("stepSize")) == ("10.0", "0.1")
    with zipfile.ZipFile(path) as package:
        package.extract("resources/platform.fmu", tmp_path)
    fmu = tmp_path / "resources" / "platform.fmu"
    assert validate_fmu(str(fmu)) == []
    assert fmpy.simulate_fmu(str(fmu), stop_time=0.1, output=["arm_length"])[0][1] == 0.7


def test_a_baked_package_has_no_parameter_sets(
    version: int, package: zipfile.ZipFile, tmp_path: Path
) -> None:
    baked = zipfile.ZipFile(export_ssp(SCENARIO, tmp_path / "x.ssp", version=version, bake=True))
    assert not [name for name in baked.namelist() if name.endswith(".ssv")]
    assert b"ParameterBinding" not in baked.read("SystemStructure.ssd")
    assert b"ParameterBinding" in package.read("SystemStructure.ssd")
    structure = etree.fromstring(baked.read("SystemStructure.ssd"))
    etree.XMLSchema(file=str(SCHEMAS[version] / KINDS[".ssd"])).assertValid(structure)


def test_the_single_fmu_is_valid_and_has_every_output(tmp_path: Path) -> None:
    path = export_fmu(SCENARIO, tmp_path / "x.fmu")
    assert validate_fmu(str(path)) == []
    description = fmpy.read_model_description(str(path))
    found = {v.name for v in description.modelVariables}
    assert found == {"time"} | {
        f"{name}.{element}"
        for name in ("target", "platform", "acoustics", "ekf")
        for variable in COMPONENTS[name].of("output")
        for element in variable.elements
    }
    assert not {v.causality for v in description.modelVariables} & {"input", "parameter"}
    assert float(description.defaultExperiment.stopTime) == 10.0


def export(path: Path, what: str, **options: Any) -> None:
    (export_ssp if what == "ssp" else export_fmu)(SCENARIO, path, **options)


@pytest.mark.parametrize("what", ["ssp", "fmu"])
def test_a_python_component_is_refused_before_anything_is_written(
    what: str, tmp_path: Path
) -> None:
    (tmp_path / "x").write_text("earlier")
    with pytest.raises(
        ConfigurationError, match=r"Mirror: must be an FMU to be exported, got the Python component"
    ):
        export(tmp_path / "x", what, receiver=Mirror)
    assert [(f.name, f.read_text()) for f in tmp_path.iterdir()] == [("x", "earlier")]


def test_a_receiver_of_somebody_else_is_exported(
    receiver: Callable[..., Path], tmp_path: Path
) -> None:
    path = export_ssp(SCENARIO, tmp_path / "x.ssp", receiver(), bake=True)
    package = zipfile.ZipFile(path)
    assert described(package, "receiver").get("guid") == "receiver-in-c-1"
    assert "resources/receiver.ssv" not in package.namelist()  # it has no parameters
    structure = etree.fromstring(package.read("SystemStructure.ssd"))
    etree.XMLSchema(file=str(SCHEMAS[1] / KINDS[".ssd"])).assertValid(structure)


def test_an_fmu_of_the_wrong_version_is_refused(
    receiver: Callable[..., Path], tmp_path: Path
) -> None:
    with pytest.raises(ConfigurationError, match=r"receiver: must be FMI 3 for SSP 2\.0, got FMI"):
        export_ssp(SCENARIO, tmp_path / "x.ssp", receiver(), version=2)
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize("what", ["ssp", "fmu"])
def test_somebody_elses_fmu_with_parameters_cannot_be_baked(
    what: str, receiver: Callable[..., Path], tmp_path: Path
) -> None:
    def with_interval(start: str) -> Path:
        parameter = (
            '<ScalarVariable name="update_interval" valueReference="24" causality="parameter" '
            f'variability="fixed"><Real unit="s" start="{start}"/></ScalarVariable>'
        )
        return receiver(("</ModelVariables>", f"{parameter}</ModelVariables>"))

    bake = {"bake": True} if what == "ssp" else {}
    with pytest.raises(
        ConfigurationError,
        match=r"receiver: cannot be baked.* its update_interval must start as 0\.2, got 0\.1",
    ):
        export(tmp_path / "x", what, receiver=with_interval("0.1"), **bake)
    assert not [*tmp_path.iterdir()]
    export(tmp_path / "x", what, receiver=with_interval("0.2"), **bake)
    assert (tmp_path / "x").is_file()


def test_a_unit_that_means_something_else_elsewhere_is_left_to_the_fmu(
    receiver: Callable[..., Path], tmp_path: Path
) -> None:
    speed = (
        '<ScalarVariable name="speed" valueReference="24" causality="output"><Real unit="m/s"/>'
        "</ScalarVariable>"
    )
    odd = receiver(
        ("<UnitDefinitions>", '<UnitDefinitions><Unit name="m/s"><BaseUnit factor="0.5"/></Unit>'),
        ("</ModelVariables>", f"{speed}</ModelVariables>"),
    )
    package = zipfile.ZipFile(export_ssp(SCENARIO, tmp_path / "x.ssp", odd))
    structure = etree.fromstring(package.read("SystemStructure.ssd"))
    ours, theirs = (
        structure.find(f".//ssd:Component[@name='{component}']//ssd:Connector[@name='{name}']", NS)
        for component, name in (("target", "velocity[1]"), ("receiver", "speed"))
    )
    assert (ours[0].get("unit"), theirs[0].get("unit")) == ("m/s", None)


def test_an_enumeration_is_written_as_its_number_and_read_by_its_items(
    receiver: Callable[..., Path], tmp_path: Path
) -> None:
    def variable(name: str, causality: str, start: str) -> str:
        return (
            f'<ScalarVariable name="{name}" valueReference="3" causality="{causality}" '
            f'variability="{"fixed" if start else "discrete"}">'
            f'<Enumeration declaredType="Mode" {start}/></ScalarVariable>'
        )

    two = variable("mode", "parameter", 'start="1"') + variable("state", "output", "")
    types = (
        '<TypeDefinitions><SimpleType name="Mode"><Enumeration><Item name="a" value="1"/>'
        '<Item name="b" value="2"/></Enumeration></SimpleType></TypeDefinitions>'
    )
    fmu = receiver(
        ("</UnitDefinitions>", f"</UnitDefinitions>{types}"),
        ("</ModelVariables>", f"{two}</ModelVariables>"),
    )
    scenario = {**SCENARIO, "receiver": {"fmu": str(fmu), "parameters": {"mode": 2}}}
    package = zipfile.ZipFile(export_ssp(scenario, tmp_path / "x.ssp"))
    values = etree.fromstring(package.read("resources/receiver.ssv"))
    (parameter,) = values.iterfind(".//ssv:Parameter", NS)
    assert (parameter.get("name"), parameter[0].get("value")) == ("mode", "2")
    assert parameter[0].tag == f"{{{NS['ssv']}}}Integer"
    assert b'name="state"' not in package.read("SystemStructure.ssd")
    for item, number in (("b", 2), ("a", 1), ("c", None)):
        named = tmp_path / f"{item}.ssp"
        with zipfile.ZipFile(named, "w") as other:
            for name in package.namelist():
                content = package.read(name)
                if name.endswith("receiver.ssv"):
                    as_item = b'Enumeration value="%s"' % item.encode()
                    content = re.sub(rb'Integer value="2"', as_item, content)
                other.writestr(name, content)
        done = CliRunner().invoke(app, ["plan", str(named), "--json"])
        if number is None:
            assert "receiver.mode: must be a, b, got 'c'" in done.stderr
            continue
        of = {it["name"]: it["values"] for it in json.loads(done.stdout)["parameters"]}
        assert of["receiver.mode"] == [number]


def test_the_toolbox_is_named_if_it_is_missing(
    tmp_path: Path, seam: Seam
) -> None:
    seam.instead(importlib.util.find_spec, lambda name: None)
    with pytest.raises(ConfigurationError, match="pip install fmu-manipulation-toolbox"):
        export_fmu(SCENARIO, tmp_path / "x.fmu")


@pytest.mark.parametrize(("what", "name"), [("ssp", "it.ssp"), ("fmu", "it.fmu")])
def test_the_command_writes_the_file_and_prints_its_name(
    what: str, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "it.toml").write_text(sblcosim.load(SCENARIO | {"name": "it"}).dump_toml())
    done = CliRunner().invoke(app, ["export", what, "it.toml", "--set", "seed=1"])
    assert (done.exit_code, done.stdout) == (0, f"{name}\n"), done.output
    assert zipfile.is_zipfile(tmp_path / name)
    refused = CliRunner().invoke(app, ["export", what, "it.toml", "--out", str(tmp_path)])
    assert refused.exit_code == 2
    assert "must be writable" in refused.stderr
