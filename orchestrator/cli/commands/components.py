"""Commands for FMUs: build ours, check any."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from ...errors import ConfigurationError, FmuError
from ..common import completion
from ..common.app import JsonOption, app, numeric, say, show, waiting

FmuArgument = Annotated[
    Path, typer.Argument(metavar="FILE.fmu", readable=False, help="The FMU to examine.")
]


@app.command()
def build(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="NAME", help="Components; none: all.", autocompletion=completion.components,
        ),
    ] = None,
    fmi: Annotated[
        int | None, numeric("--fmi", int, "2|3", "FMI version; none: both.", low=2, high=3)
    ] = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the FMUs.")] = (
        Path("fmus")
    ),
    beacons: Annotated[
        int | None,
        numeric("--beacons", int, "N", "Number of beacons, 3 to 8; none: 4."),
    ] = None,
    all_platforms: Annotated[
        bool,
        typer.Option(
            "--all-platforms",
            help="One file for Linux and macOS on x86-64 and ARM, and Windows on x86-64; none: for "
            "this machine only.",
        ),
    ] = False,
    platform: Annotated[
        str | None,
        typer.Option("--platform", metavar="wasm32", help="Also include it as WebAssembly."),
    ] = None,
) -> None:
    """Build our components as FMUs.

    The files are DIR/fmi2/NAME.fmu and DIR/fmi3/NAME.fmu. With six beacons, components that depend
    on the number are called NAME6.fmu.
    """
    from sblcosim.fmus.build.factory import Wanted, build_all
    from sblcosim.fmus.platforms import WASM
    from sblcosim.models import COMPONENTS

    from ...artifacts import check_place

    if platform not in (None, WASM):
        raise ConfigurationError(
            f"--platform: must be {WASM}, got {platform!r}; --all-platforms has all others"
        )
    constants = {} if beacons is None else {"beacons": beacons}
    wanted = [
        Wanted(name, version, all_platforms, constants=constants, wasm=platform == WASM)
        for version in ((2, 3) if fmi is None else (fmi,))
        for name in (names or COMPONENTS)
    ]
    for one in wanted:
        check_place(out / f"fmi{one.fmi}")
    with waiting("building"):
        built = build_all(wanted)
        places = [out / f"fmi{w.fmi}" / c.name for w, c in zip(wanted, built, strict=True)]
        _copy(built, places)
    for path in places:
        typer.echo(str(path))


def _copy(built: Sequence[Path], places: Sequence[Path]) -> None:
    from sblcosim.fmus.files import write_file

    for path, cached in zip(places, built, strict=True):
        try:
            write_file(path, cached.read_bytes())
        except OSError as error:
            refused = f"{path}: must be writable, got {error.strerror}"
            raise ConfigurationError(refused) from None


@app.command()
def check(
    file: FmuArgument,
    as_json: JsonOption = False,
) -> None:
    """Report whether an FMU can be a receiver.

    Compares its variables with the contract and loads it. The exit code is 1 if either fails.
    """
    from sblcosim.fmus.conformance.receiver_contract import check_receiver

    report = check_receiver(file, load=True)
    if as_json:
        from ..documents.by_command import Check

        findings = [asdict(finding) for finding in report.findings]
        show(Check.of({"fmu": str(report.path), "ok": report.ok, "findings": findings}))
    else:
        say(str(report))
    if not report.ok:
        raise typer.Exit(1)


@app.command()
def conformance(
    file: FmuArgument,
    checks: Annotated[
        list[str] | None,
        typer.Option("--check", metavar="NAME", help="Run only this check; can be repeated."),
    ] = None,
    timeout: Annotated[
        float,
        numeric("--timeout", float, "SECONDS", "Time limit for a call.", low=0.1),
    ] = 30.0,
    strict: Annotated[
        bool, typer.Option("--strict", help="Exit with code 1 for warnings too.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Check that an FMU keeps the promises of FMI 2 or 3 Co-Simulation and its own.

    A check fails if the standard is violated. Lawful behaviour that hurts users is a warning.
    Crashes and calls that do not return are findings. A check is blocked if this machine lacks
    something that the FMU needs, such as a library or a licence. The exit code is 1 if a check
    fails, and 2 if FILE.fmu cannot be checked or a check is blocked.
    """
    from sblcosim.fmus.conformance.kit import CheckResult, examine

    def say_so(result: CheckResult) -> None:
        if not as_json:
            say(str(result))
            sys.stdout.flush()  # into a file too, so that its reader sees the progress

    with waiting("checking"):
        report = examine(file, only=checks or (), patience=timeout, each=say_so)
    if as_json:
        from ..documents.by_command import Conformance

        show(Conformance.of(report.to_json()))
    else:
        say(report.summary)
    if report.ok and report.blocked is not None:
        raise FmuError(f"{file}: must find here what it needs, got: {report.blocked}")
    if not report.ok or (strict and report.count("warning")):
        raise typer.Exit(1)
