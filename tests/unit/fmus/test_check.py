"""The plug contract: what it asks for, what it lets pass, and how it says so."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import get_args
from xml.sax.saxutils import quoteattr

import pytest
from sblcosim.fmus.build import compiler, factory
from sblcosim.fmus.build.archive import contents, write_fmu
from sblcosim.fmus.conformance.receiver_contract import ContractReport, check_receiver
from sblcosim.fmus.errors import FmuError
from sblcosim.fmus.platforms import folder, suffix, this_platform
from sblcosim.fmus.standard import Fmi
from sblcosim.fmus.terminals import TERMINALS
from sblcosim.models import COMPONENTS, RECEIVERS
from sblcosim.models.equations import Model
from sblcosim.models.ports import PING_POSE, SYSTEM
from seams import Seam

VERSIONS = get_args(Fmi)
HANG = (Path(__file__).parents[2] / "fmu" / "hang.h").read_bytes()
FUNCTIONS = set(
    re.findall(
        r"FMI2_Export\s+\w+TYPE\s+(\w+);",
        (factory.fmi_headers() / "fmi2Functions.h").read_text(),
    )
)
"""All functions of FMI 2."""
REQUIRED = {
    "epoch": "Real output s",
    "position[1]": "Real output m",
    "position[2]": "Real output m",
    "position[3]": "Real output m",
    "update_count": "Integer output",
}
UNITS = (
    '<Unit name="m"><BaseUnit m="1"/></Unit><Unit name="s"><BaseUnit s="1"/></Unit>'
    '<Unit name="metre"><BaseUnit m="1"/></Unit>'
    '<Unit name="mm"><BaseUnit m="1" factor="0.001"/></Unit>'
)


def here(fmi: Fmi) -> str:
    return folder(this_platform(), fmi)


def binary(fmi: Fmi) -> dict[str, bytes]:
    return {f"binaries/{here(fmi)}/R{suffix(here(fmi))}": b""}


def fmi2(variables: Mapping[str, str], interface: str = "CoSimulation") -> bytes:
    """A model description written by hand; a variable is its type, causality and unit."""
    scalars = ""
    for reference, (name, text) in enumerate(variables.items()):
        kind, causality, *unit = text.split()
        variability = "continuous" if kind == "Real" else "discrete"
        start = ' start="0"' if causality == "input" else ""
        scalars += (
            f'<ScalarVariable name={quoteattr(name)} valueReference="{reference}" '
            f'causality="{causality}" variability="{variability}"><{kind}{start}'
            + "".join(f' unit="{u}"' for u in unit)
            + "/></ScalarVariable>"
        )
    return (
        '<fmiModelDescription fmiVersion="2.0" modelName="R" guid="g">'
        f'<{interface} modelIdentifier="R"/><UnitDefinitions>{UNITS}</UnitDefinitions>'
        f"<ModelVariables>{scalars}</ModelVariables><ModelStructure/></fmiModelDescription>"
    ).encode()


def checked(
    folder: Path, description: bytes, files: Mapping[str, bytes] | None = None
) -> ContractReport:
    path = folder / "receiver.fmu"
    write_fmu(
        path, {"modelDescription.xml": description, **(binary(2) if files is None else files)}
    )
    return check_receiver(path)


def complaints(report: ContractReport) -> dict[str, str]:
    """Severity and message of what was not in order, by variable."""
    return {v: f"{s}: {m}" for v, s, m in report.rows if s in ("warning", "error")}


@pytest.mark.parametrize("fmi", VERSIONS)
@pytest.mark.parametrize("name", RECEIVERS)
@pytest.mark.parametrize("plugs", [True, False], ids=["terminals", "names"])
def test_own_receivers_honour_the_contract(
    tmp_path: Path, name: str, fmi: Fmi, plugs: bool
) -> None:
    model = Model(RECEIVERS[name], variants={}, states={}, draws=(), advance=(), iterate=())
    files = dict(contents(model, fmi, "token", {}, {here(fmi): b""}))
    if not plugs:
        del files[TERMINALS]
    write_fmu(tmp_path / "r.fmu", files)
    report = check_receiver(tmp_path / "r.fmu")
    assert report.ok
    ports = {v.name for v in RECEIVERS[name] if v.causality != "parameter"}
    optional = {v.name for v in (*PING_POSE, *SYSTEM)}
    assert {f.variable for f in report.findings if f.severity == "ok"} == {"FMU", *ports}
    assert {f.variable for f in report.findings if f.severity == "absent"} == optional - ports
    assert {f.severity for f in report.findings} <= {"ok", "absent"}
    assert report.names == {port: (port,) for port in ports}


def test_a_component_that_is_no_receiver_is_told_what_is_missing(tmp_path: Path) -> None:
    model = Model(COMPONENTS["target"], variants={}, states={}, draws=(), advance=(), iterate=())
    write_fmu(tmp_path / "t.fmu", contents(model, 2, "token", {}, {here(2): b""}))
    found = complaints(check_receiver(tmp_path / "t.fmu"))
    assert found.keys() == {"epoch", "update_count", "depth", "depth_epoch"}
    assert found["depth"] == "error: must be an input, got output"


def test_the_required_outputs_are_enough(tmp_path: Path) -> None:
    report = checked(tmp_path, fmi2(REQUIRED | {"mood": "Real output"}))
    assert report.ok
    assert complaints(report) == {}
    assert report.names == {name: (name,) for name in ("epoch", "position", "update_count")}
    assert {f.variable for f in report.of("absent")} > {"range", "depth", "covariance", "nis"}
    assert "honours the plug contract of a receiver (0 errors, 0 warnings)" in str(report)


@pytest.mark.parametrize("missing", ["epoch", "position", "update_count"])
def test_a_missing_required_output_is_an_error(tmp_path: Path, missing: str) -> None:
    variables = {k: v for k, v in REQUIRED.items() if not k.startswith(missing)}
    report = checked(tmp_path, fmi2(variables))
    assert not report.ok
    assert complaints(report) == {missing: "error: must be an output, got none"}
    assert "does not honour the plug contract" in str(report)
    assert "(1 error, 0 warnings)" in str(report)


def test_a_misspelt_output_is_recognised(tmp_path: Path) -> None:
    variables = {k.replace("update_count", "updates_count"): v for k, v in REQUIRED.items()}
    found = complaints(checked(tmp_path, fmi2(variables)))
    assert found["update_count"].endswith("; did you mean 'updates_count'?")


@pytest.mark.parametrize(
    ("changes", "variable", "complaint"),
    [
        ({"epoch": "Real input s"}, "epoch", "error: must be an output, got input"),
        (
            {"update_count": "Real output"},
            "update_count",
            "error: must be of type Integer, got Real",
        ),
        ({"valid": "Integer output"}, "valid", "error: must be of type Boolean, got Integer"),
        ({"position[2]": "Boolean output"}, "position", "error: must be of type Real, got Boolean"),
        (
            {"position[4]": "Real output m"},
            "position",
            "error: must be an array of 3, got an array of 4",
        ),
        ({"nis[1]": "Real output"}, "nis", "error: must be a scalar, got an array of 1"),
        ({"velocity": "Real output m/s"}, "velocity", "error: must be an array of 3, got a scalar"),
        (
            {"velocity[1]": "Real output m/s", "velocity[3]": "Real output m/s"},
            "velocity",
            "error: must have all elements of an array of 3, got velocity[1], velocity[3]",
        ),
        (
            {"velocity[1]": "Real output m/s", "velocity[1,2]": "Real output m/s"},
            "velocity",
            "error: must have all elements of an array of 3, got velocity[1], velocity[1,2]",
        ),
        ({"depth": "Real output m"}, "depth", "error: must be an input, got output"),
        ({"depth": "Real input mm"}, "depth", "error: must be in m, got mm"),
        ({"depth": "Real input s"}, "depth", "error: must be in m, got s"),
        ({"depth": "Real input"}, "depth", "warning: must be in m, got no unit"),
        ({"position[2]": "Real output"}, "position", "warning: must be in m, got no unit"),
        (
            {"depth_time": "Real input s"},
            "depth_time",
            "warning: is not a port: will keep its start value; did you mean 'depth_epoch'?",
        ),
    ],
)
def test_each_mismatch_is_named(
    tmp_path: Path, changes: Mapping[str, str], variable: str, complaint: str
) -> None:
    report = checked(tmp_path, fmi2(REQUIRED | changes))
    assert complaints(report) == {variable: complaint}
    assert report.ok == complaint.startswith("warning")


def test_a_unit_counts_by_its_definition_not_by_its_name(tmp_path: Path) -> None:
    assert checked(tmp_path, fmi2(REQUIRED | {"depth": "Real input metre"})).ok
    description = fmi2(REQUIRED).replace(
        b'<Unit name="s"><BaseUnit s="1"/>', b'<Unit name="s"><BaseUnit s="1" factor="60"/>'
    )
    assert complaints(checked(tmp_path, description)) == {
        "epoch": "error: must be in s, got s (by its definition)"
    }


def test_fmi3_arrays_are_compared_by_shape_and_type(tmp_path: Path) -> None:
    def description(size: int, kind: str) -> bytes:
        return (
            '<fmiModelDescription fmiVersion="3.0" modelName="R" instantiationToken="t">'
            '<CoSimulation modelIdentifier="R"/>'
            f"<UnitDefinitions>{UNITS}</UnitDefinitions><ModelVariables>"
            '<Float64 name="time" valueReference="0" causality="independent"/>'
            '<Float64 name="epoch" valueReference="1" causality="output" unit="s"/>'
            '<Float64 name="position" valueReference="2" causality="output" unit="m">'
            f'<Dimension start="{size}"/></Float64>'
            f'<{kind} name="update_count" valueReference="3" causality="output"/>'
            "</ModelVariables><ModelStructure/></fmiModelDescription>"
        ).encode()

    assert complaints(checked(tmp_path, description(3, "Int32"), binary(3))) == {}
    assert complaints(checked(tmp_path, description(2, "Int64"), binary(3))) == {
        "position": "error: must be an array of 3, got an array of 2",
        "update_count": "error: must be of type Int32, got Int64",
    }


def terminals(kind: str, members: Mapping[str, str]) -> dict[str, bytes]:
    lines = "".join(
        f'<TerminalMemberVariable variableName="{variable}" memberName="{member}" '
        'variableKind="signal"/>'
        for variable, member in members.items()
    )
    return {
        TERMINALS: (
            '<fmiTerminalsAndIcons fmiVersion="3.0"><Terminals>'
            f'<Terminal name="out" matchingRule="plug" terminalKind="{kind}">{lines}</Terminal>'
            "</Terminals></fmiTerminalsAndIcons>"
        ).encode()
    }


def test_a_terminal_gives_ports_other_names(tmp_path: Path) -> None:
    members = {f"fix.{name}": name for name in REQUIRED}
    description = fmi2({variable: REQUIRED[name] for variable, name in members.items()})
    files = binary(2) | terminals("org.sblcosim.estimate", members)
    report = checked(tmp_path, description, files)
    assert complaints(report) == {}
    assert report.names["position"] == ("fix.position",)
    assert ("position", "ok", "output Float64 [3] in m; fix.position by a terminal") in report.rows
    other_kind = binary(2) | terminals("org.example.estimate", members)
    assert complaints(checked(tmp_path, description, other_kind)).keys() == {
        "epoch",
        "position",
        "update_count",
    }


def test_a_terminal_with_unknown_variables_or_members_is_reported(tmp_path: Path) -> None:
    broken = terminals("org.sblcosim.estimate", {"epoc": "epoch"})
    assert complaints(checked(tmp_path, fmi2(REQUIRED), binary(2) | broken)) == {
        "terminal out": "error: must list variables of the FMU, got 'epoc'; did you mean 'epoch'?",
    }
    unknown = terminals("org.sblcosim.estimate", {"epoch": "mood"})
    assert complaints(checked(tmp_path, fmi2(REQUIRED), binary(2) | unknown)) == {
        "terminal out": "warning: must list members of org.sblcosim.estimate only, got 'mood'",
    }


def test_the_types_of_ports_by_a_terminal_are_checked(tmp_path: Path) -> None:
    members = {"fix.epoch": "epoch"}
    description = fmi2(REQUIRED | {"fix.epoch": "Real output m"})  # and one without a terminal
    files = binary(2) | terminals("org.sblcosim.estimate", members)
    assert complaints(checked(tmp_path, description, files)) == {
        "epoch": "error: must be in s, got m",
    }


def test_an_array_put_together_from_several_variables_is_a_port(tmp_path: Path) -> None:
    members = {"north": "position[1]", "east": "position[2]", "down": "position[3]"}
    variables = {k: v for k, v in REQUIRED.items() if "position" not in k}
    description = fmi2(variables | dict.fromkeys(members, "Real output m"))
    files = binary(2) | terminals("org.sblcosim.estimate", members)
    report = checked(tmp_path, description, files)
    assert complaints(report) == {}
    assert report.names["position"] == ("north", "east", "down")


def test_an_fmu_for_other_machines_says_which(tmp_path: Path) -> None:
    files = {"binaries/win32/R.dll": b"", "binaries/plan9/R.so": b""}
    assert complaints(checked(tmp_path, fmi2(REQUIRED), files)) == {
        "FMU": f"error: must have a binary for {here(2)}, got plan9, win32",
    }
    assert complaints(checked(tmp_path, fmi2(REQUIRED), {}))["FMU"].endswith("got no binary at all")


def test_an_fmi2_fmu_may_use_the_folder_names_of_fmi3(tmp_path: Path) -> None:
    assert checked(tmp_path, fmi2(REQUIRED), binary(3)).ok


def test_model_exchange_is_refused(tmp_path: Path) -> None:
    assert complaints(checked(tmp_path, fmi2(REQUIRED, "ModelExchange"))) == {
        "FMU": "error: must be an FMU for Co-Simulation, got Model Exchange",
    }


@pytest.mark.parametrize(
    ("description", "reason"),
    [
        (b"<fmiModelDescription", "modelDescription.xml must be well-formed XML, got unclosed"),
        (b"<other/>", "must be FMI 2.0 or 3.0, got no version"),
        (fmi2(REQUIRED).replace(b'"2.0"', b'"1.0"'), "must be FMI 2.0 or 3.0, got 1.0"),
        (
            fmi2(REQUIRED).replace(b"valueReference", b"reference"),
            "modelDescription.xml must be valid, got: ",
        ),
    ],
)
def test_a_broken_description_gives_one_line_that_names_the_file(
    tmp_path: Path, description: bytes, reason: str
) -> None:
    with pytest.raises(FmuError, match=re.escape(reason)) as caught:
        checked(tmp_path, description)
    message = str(caught.value)
    assert message.startswith(str(tmp_path / "receiver.fmu"))
    assert "\n" not in message


def test_a_broken_file_gives_one_line_that_names_the_file(tmp_path: Path) -> None:
    (tmp_path / "text.fmu").write_text("not an archive")
    write_fmu(tmp_path / "empty.fmu", {"readme.txt": b""})
    write_fmu(tmp_path / "cut.fmu", {"modelDescription.xml": fmi2(REQUIRED)})
    whole = (tmp_path / "cut.fmu").read_bytes()
    (tmp_path / "cut.fmu").write_bytes(whole[:100] + b"\0" * 50 + whole[150:])
    for name, reason in {
        "none.fmu": "must be an FMU, got no file",
        "": "must be an FMU, got a folder",
        "text.fmu": r"is not an FMU \(not a ZIP archive\)",
        "cut.fmu": "must be an intact ZIP archive",
        "empty.fmu": "must contain modelDescription.xml, got only 1 other file",
    }.items():
        with pytest.raises(FmuError, match=reason) as caught:
            check_receiver(tmp_path / name)
        assert str(caught.value).startswith(str(tmp_path / name))
        assert "\n" not in str(caught.value)


def test_checking_needs_no_casadi() -> None:
    module = "sblcosim.fmus.conformance.receiver_contract"
    code = f"import sys, {module}; sys.exit('casadi' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_binary_that_does_not_load_is_an_error_on_demand(tmp_path: Path) -> None:
    assert checked(tmp_path, fmi2(REQUIRED)).ok
    for content, reason in ((b"", "file too short"), (b"#!" + bytes(200), "invalid ELF header")):
        write_fmu(
            tmp_path / "r.fmu",
            {"modelDescription.xml": fmi2(REQUIRED), **dict.fromkeys(binary(2), content)},
        )
        report = check_receiver(tmp_path / "r.fmu", load=True)
        assert complaints(report) == {"binary": f"error: the library does not load: {reason}"}


def compiled(code: bytes) -> bytes:
    """A shared library of some C code."""
    return factory.compile_shared(
        {"x.c": code, "hang.h": HANG}, [factory.Unit("x.c")], compiler.find()
    )


def test_a_library_that_is_no_fmu_is_told_so(tmp_path: Path) -> None:
    code = b"int nothing(void);int nothing(void){return 0;}"
    files = dict.fromkeys(binary(2), compiled(code))
    write_fmu(tmp_path / "r.fmu", {"modelDescription.xml": fmi2(REQUIRED), **files})
    report = check_receiver(tmp_path / "r.fmu", load=True)
    assert complaints(report) == {
        "binary": "error: it does not export fmi2GetTypesPlatform, fmi2GetVersion, "
        "fmi2SetDebugLogging and 31 more"
    }


def test_a_binary_that_crashes_while_it_loads_is_told_so(tmp_path: Path) -> None:
    code = b"#include <signal.h>\n__attribute__((constructor)) static void f(void){raise(SIGSEGV);}"
    files = dict.fromkeys(binary(2), compiled(code))
    write_fmu(tmp_path / "r.fmu", {"modelDescription.xml": fmi2(REQUIRED), **files})
    report = check_receiver(tmp_path / "r.fmu", load=True)
    assert complaints(report) == {"binary": "error: crashes (SIGSEGV) in loading the library"}


@pytest.mark.parametrize(
    ("where", "what", "ending"),
    [
        ("__attribute__((constructor)) static void f(void)", "exit(0);",
         "ends the process (exit code 0x0) in loading the library"),
        ("void *fmi2Instantiate(void)", "exit(0);",
         "ends the process (exit code 0x0) in fmi2Instantiate"),
        ("void *fmi2Instantiate(void)", "abort();", "crashes (SIGABRT) in fmi2Instantiate"),
        ("void *fmi2Instantiate(void)", "hang();",
         "has not returned after 2 s from fmi2Instantiate"),
        ("void *fmi2Instantiate(void)", "return 0;", "fmi2Instantiate must succeed, got Error"),
        ("void *fmi2Instantiate(void)", "static int x; return &x;", ""),
        ("void *fmi2Instantiate(void)", "printf(\"loaded\\n\"); _exit(0);",
         "ends the process (exit code 0x0) in fmi2Instantiate"),
    ],
    ids=["exit while loading", "exit", "abort", "hang", "refused", "sound", "exit after output"],
)  # fmt: skip
@pytest.mark.usefixtures("only_hangs_take_time")
def test_an_fmu_that_does_not_live_to_be_instantiated_is_not_sound(
    tmp_path: Path, seam: Seam, where: str, what: str, ending: str
) -> None:
    seam.tuned(patience=2.0)
    functions = {f for f in FUNCTIONS if f != "fmi2Instantiate"}
    rest = "".join(f"int {name}(void) {{ return 3; }}\n" for name in sorted(functions))
    if "fmi2Instantiate" not in where:
        rest += "void *fmi2Instantiate(void) { return 0; }\n"
    headers = '#include "hang.h"\n#pragma GCC visibility push(default)\n' + "".join(
        f"#include <{name}.h>\n" for name in ("stdio", "stdlib", "unistd")
    )
    code = f"{headers}{where} {{ {what} }}\n{rest}".encode()
    files = dict.fromkeys(binary(2), compiled(code))
    write_fmu(tmp_path / "r.fmu", {"modelDescription.xml": fmi2(REQUIRED), **files})
    report = check_receiver(tmp_path / "r.fmu", load=True)
    assert complaints(report) == ({"binary": f"error: {ending}"} if ending else {})
    assert report.ok == (not ending)


@pytest.mark.parametrize("fmi", VERSIONS)
def test_the_binaries_of_our_receivers_load(fmi: Fmi) -> None:
    assert complaints(check_receiver(factory.build("ekf", fmi), load=True)) == {}
