import subprocess
import sys
import zipfile
from pathlib import Path

import fmpy
import pytest
from sblcosim.errors import FmuError
from sblcosim.fmus.host import libraries
from sblcosim.fmus.host.instances import acquire, release
from sblcosim.fmus.read import description
from sblcosim.fmus.read.ports import Port, ports_of, read
from sblcosim.models.declaration import parameter
from stranger import build_stranger

INF = float("inf")


def refusal(path: Path) -> str:
    with pytest.raises(FmuError) as caught:
        read(path)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(tuple(f"{path}: {how}" for how in ("must ", "is not ", "modelDesc")))
    return message


def archive(path: Path, **files: str) -> Path:
    with zipfile.ZipFile(path, "w") as out:
        for name, text in files.items():
            out.writestr(name.replace("__", "/").replace("_xml", ".xml"), text)
    return path


def test_scalars_of_fmi_2_and_arrays_of_fmi_3_look_the_same(stranger):
    two, three = (read(stranger(fmi)).ports for fmi in (2, 3))
    assert two.keys() == three.keys()
    for name in two:
        a, b = two[name], three[name]
        assert (a.causality, a.type, a.shape, a.unit, a.start, a.min, a.max) == (
            b.causality, b.type, b.shape, b.unit, b.start, b.min, b.max
        )  # fmt: skip


def test_elements_are_ordered_by_index_not_by_their_place_in_the_file(stranger):
    y = read(stranger(2)).ports["y"]
    names = ("y[1,1]", "y[1,2]", "y[2,1]", "y[2,2]")
    bounds = (-INF,) * 4, (INF,) * 4
    references = (500, 501, 502, 503)
    assert y == Port("y", "output", "Float64", (2, 2), "m", None, *bounds, references, names)


@pytest.mark.parametrize(
    ("was", "becomes"),
    [
        ('name="u[2]"', 'name="u[3]"'),
        ('name="u[2]"', 'name="u[1,2]"'),
        ('name="u[2]" valueReference="401" causality="input"',
         'name="u[2]" valueReference="401" causality="local"'),
    ],
    ids=["an index is missing", "dimensions differ", "causality differs"],
)  # fmt: skip
def test_scalars_that_make_up_no_array_stay_scalars(tmp_path, was, becomes):
    path = build_stranger(2, tmp_path, lambda text: text.replace(was, becomes))
    ports = read(path).ports
    assert "u" not in ports
    assert ports["u[1]"].shape == ()


def test_bounds_and_units_come_from_the_declared_type_too(tmp_path):
    def edit(text: str) -> str:
        types = (
            '<TypeDefinitions><SimpleType name="Length"><Real unit="m" min="-3"/></SimpleType>'
            "</TypeDefinitions><ModelVariables>"
        )
        text = text.replace("<ModelVariables>", types)
        return text.replace('<Real start="1" max="10"/>', '<Real declaredType="Length" start="1"/>')

    gain = read(build_stranger(2, tmp_path, edit)).ports["gain"]
    assert (gain.unit, gain.min, gain.max) == ("m", (-3.0,), (INF,))


def test_a_declaration_makes_ports_with_bounds_per_element():
    (port,) = ports_of([parameter("x", "", "m", shape=(2,), start=(1.0, 2.0), min=0.0)]).values()
    assert port == Port("x", "parameter", "Float64", (2,), "m", (1.0, 2.0), (0.0, 0.0), (INF, INF))


def test_a_missing_file_is_named(tmp_path):
    assert refusal(tmp_path / "no.fmu").endswith(": must be an FMU, got no file")


def test_a_folder_is_no_fmu(tmp_path):
    refusal(tmp_path)


def test_a_file_that_is_no_zip_archive_is_named(tmp_path):
    path = tmp_path / "text.fmu"
    path.write_text("hello")
    assert refusal(path).endswith(": is not an FMU (not a ZIP archive)")


def test_an_archive_without_model_description_is_named(tmp_path):
    message = refusal(archive(tmp_path / "empty.fmu", other_xml="<a/>"))
    assert message.endswith("must contain modelDescription.xml, got only 1 other file")


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("<fmiModelDescription", "modelDescription.xml must be well-formed XML, got unclosed"),
        ('<fmiModelDescription fmiVersion="4.0"/>', "must be FMI 2.0 or 3.0, got 4.0"),
        ('<fmiModelDescription fmiVersion="2.0"/>', "modelDescription.xml must be valid, got: "),
        ("<html/>", "must be FMI 2.0 or 3.0, got no version"),
    ],
)
def test_a_broken_model_description_is_named(tmp_path, text, reason):
    message = refusal(archive(tmp_path / "broken.fmu", modelDescription_xml=text))
    assert reason in message


def test_fmi_1_is_refused(tmp_path):
    text = (
        '<fmiModelDescription fmiVersion="1.0" modelName="a" modelIdentifier="a" guid="a" '
        'numberOfContinuousStates="0" numberOfEventIndicators="0"><ModelVariables/>'
        "</fmiModelDescription>"
    )
    message = refusal(archive(tmp_path / "1.fmu", modelDescription_xml=text))
    assert "must be FMI 2.0 or 3.0, got 1.0" in message


@pytest.mark.parametrize("fmi", [2, 3])
def test_an_fmu_for_model_exchange_only_is_refused(tmp_path, fmi):
    path = build_stranger(fmi, tmp_path, lambda t: t.replace("<CoSimulation", "<ModelExchange"))
    assert refusal(path).endswith("must be an FMU for Co-Simulation, got Model Exchange")


@pytest.mark.parametrize("fmi", [2, 3])
def test_an_fmu_for_another_machine_says_what_it_has(tmp_path, stranger, fmi):
    path = tmp_path / "foreign.fmu"
    with zipfile.ZipFile(stranger(fmi)) as source, zipfile.ZipFile(path, "w") as target:
        target.writestr("modelDescription.xml", source.read("modelDescription.xml"))
        target.writestr("binaries/riscv64-linux/stranger.so", "")
        target.writestr("binaries/pdp11/stranger.so", "")
    here = fmpy.platform if fmi == 2 else fmpy.platform_tuple
    assert refusal(path).endswith(f"must have a binary for {here}, got pdp11, riscv64-linux")


def test_an_fmu_for_another_processor_in_the_usual_folder_says_so(tmp_path, stranger, seam):
    path = tmp_path / "foreign.fmu"
    with zipfile.ZipFile(stranger(2)) as source, zipfile.ZipFile(path, "w") as target:
        target.writestr("modelDescription.xml", source.read("modelDescription.xml"))
        target.writestr("binaries/linux64/stranger.so", b"\x7fELF".ljust(18, b"\0") + b"\x3e\0")
    seam.instead(description.this_platform, lambda: "aarch64-linux")
    assert refusal(path).endswith(
        "must have a binary for aarch64-linux, got binaries/linux64/stranger.so for x86_64"
    )


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_wrong_token_shows_what_the_fmu_says(tmp_path, fmi):
    path = build_stranger(fmi, tmp_path, lambda text: text.replace("stranger-1", "stranger-2"))
    with pytest.raises(FmuError, match=r"^me: .*fmu must load .*: token must be stranger-1$"):
        acquire(read(path), "me")


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_binary_that_cannot_be_loaded_is_named_and_the_folder_stays(tmp_path, stranger, fmi):
    path = tmp_path / "corrupt.fmu"
    with zipfile.ZipFile(stranger(fmi)) as source, zipfile.ZipFile(path, "w") as target:
        for name in source.namelist():
            corrupt = name.startswith("binaries")
            target.writestr(name, b"no library" if corrupt else source.read(name))
    here = Path.cwd()
    with pytest.raises(FmuError, match=r"^me: .*corrupt\.fmu must load and instantiate, got: "):
        acquire(read(path), "me")
    assert Path.cwd() == here


def test_an_instance_is_used_again_after_its_release(fmu):
    first = acquire(read(fmu), "again")
    release(first)
    assert acquire(read(fmu), "again") is first


def test_an_instance_in_use_is_not_lent_twice(fmu):
    assert acquire(read(fmu), "twice") is not acquire(read(fmu), "twice")


def test_an_instance_keeps_the_name_by_which_its_messages_are_known(fmu):
    first = acquire(read(fmu), "one")
    release(first)
    assert acquire(read(fmu), "another") is not first


def test_an_instance_that_failed_fatally_is_not_used_again(fmu):
    first = acquire(read(fmu), "fatal")
    first.failure("fmiDoStep", 4)
    release(first)
    assert acquire(read(fmu), "fatal") is not first


def test_equal_files_are_one_fmu_wherever_they_lie(fmu, tmp_path):
    copy = tmp_path / "copy.fmu"
    copy.write_bytes(fmu.read_bytes())
    a, b = read(fmu), read(copy)
    assert (a.sha256, a.path, b.path) == (b.sha256, fmu, copy)
    assert a.ports is b.ports


def test_a_file_that_has_changed_is_read_again(tmp_path):
    path = build_stranger(2, tmp_path)
    assert "gain" in read(path).ports
    build_stranger(2, tmp_path, lambda text: text.replace('"gain"', '"amplification"'))
    assert "amplification" in read(path).ports


def test_messages_of_instances_made_by_others_still_reach_fmpy(fmu, capsys):
    acquire(read(fmu), "ours")
    theirs = fmpy.read_model_description(fmu)
    kind = fmpy.fmi2.FMU2Slave if read(fmu).fmi == 2 else fmpy.fmi3.FMU3Slave
    wrong = kind(
        guid="wrong",
        modelIdentifier=theirs.coSimulation.modelIdentifier,
        unzipDirectory=str(libraries.unpacked(read(fmu))),
    )
    with pytest.raises(Exception, match="Failed to instantiate"):
        wrong.instantiate()
    assert "[ERROR] token must be stranger-1" in capsys.readouterr().out


def test_unpacked_files_are_gone_when_the_process_has_ended(fmu, tmp_path):
    program = (
        "import sys, pathlib\n"
        "from sblcosim.fmus.host.instances import acquire\n"
        "from sblcosim.fmus.read.ports import read\n"
        "acquire(read(pathlib.Path(sys.argv[1])), 'x')\n"
    )
    environment = {"TMPDIR": str(tmp_path), "TMP": str(tmp_path), "PATH": ""}
    subprocess.run([sys.executable, "-c", program, fmu], check=True, env=environment)
    assert not list(tmp_path.glob("sblcosim-*"))


def test_a_binary_of_another_name_is_named(tmp_path):
    path = build_stranger(2, tmp_path)
    renamed = tmp_path / "renamed.fmu"
    with zipfile.ZipFile(path) as before, zipfile.ZipFile(renamed, "w") as after:
        for name in before.namelist():
            to = str(Path(name).with_stem("other")) if name.startswith("binaries/") else name
            after.writestr(to, before.read(name))
    message = refusal(renamed)
    assert "must have the binary binaries/" in message
    assert "/other." in message.partition(", got ")[2]
