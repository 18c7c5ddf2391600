"""Whole simulations as WebAssembly give the bits of the lanes master, in node and in a browser.

Skipped where there is no zig, and for each host where it is missing.
"""

from __future__ import annotations

import base64
import gzip
import json
import shutil
import subprocess
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sblcosim
from quick import few, one_in
from sblcosim.errors import ConfigurationError
from sblcosim.fmus.build import compiler
from sblcosim.models import RECEIVERS
from sblcosim.prepare.scenario import of_scenario
from sblcosim.scenario import starts
from sblcosim.scenario.scenario import Scenario, shipped
from sblcosim.simulation.masters import lanes as native
from sblcosim.wasm import modules, plans

pytestmark = pytest.mark.skipif(compiler.zig() is None, reason="needs ziglang")
NODE = shutil.which("node")
BROWSER = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
HOST = Path(__file__).with_name("wasm_host.mjs")
QUICK = ("paper-scenario-1", "realistic-dive")
PERCENTAGES = (1, 50, 68, 95, 100)
WORKERS = (1, 4)
RUNS = 23
"""Fills no group of lanes and no part of a worker."""
WORKER = "\nserve(self);\n"
"""From a file, Chromium starts only workers that are not modules."""
PAGE = """<!DOCTYPE html><meta charset="utf-8"><title>lanes</title>
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; worker-src blob:;
script-src 'unsafe-inline' 'wasm-unsafe-eval' blob:; connect-src {to}">
<script type="module">
const {{ script, host, worker, job }} = {given};
const address = (text) => URL.createObjectURL(new Blob([text], {{ type: "text/javascript" }}));
const send = (text) => fetch("{to}", {{ method: "POST", mode: "no-cors", body: text }});
try {{
  const [engine, {{ answer }}] = await Promise.all([script, host].map((it) => import(address(it))));
  send(await answer(engine, job, () => new Worker(address(worker))));
}} catch (error) {{
  send(JSON.stringify({{ error: `${{error.stack}}` }}));
}}
</script>
"""
Answer = Mapping[str, Any]


def in_node(job: Mapping[str, Any], folder: Path) -> Answer:
    """The answer of node."""
    if NODE is None:
        pytest.skip("needs node")
    shutil.copy(modules.SCRIPT, folder / "engine.mjs")
    shutil.copy(HOST, folder)
    (folder / "worker.mjs").write_text(
        'import { parentPort } from "node:worker_threads"; import { serve } from "./engine.mjs";'
        'parentPort.on("message", ({ hang }) => { while (hang); }); serve(parentPort);'
    )
    (folder / "job.json").write_text(json.dumps(job))
    names = (HOST.name, "engine.mjs", "worker.mjs", "job.json", "answer.json")
    subprocess.run([NODE, *names], cwd=folder, check=True, timeout=1800)
    answer: Answer = json.loads((folder / "answer.json").read_text())
    return answer


def in_chromium(job: Mapping[str, Any], folder: Path) -> Answer:
    """The answer of a page from a file, under a policy that lets it only send its answer."""
    if BROWSER is None:
        pytest.skip("needs Chromium")
    script = modules.SCRIPT.read_text()
    with receiving() as (address, received):
        worker = script.replace("\nexport ", "\n") + WORKER
        given = {"script": script, "host": HOST.read_text(), "worker": worker, "job": job}
        page = folder / "page.html"
        page.write_text(PAGE.format(given=json.dumps(given).replace("<", "\\u003c"), to=address))
        browser = subprocess.Popen(
            [BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
             "--proxy-server=direct://", "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
             f"--user-data-dir={folder / 'profile'}", page.as_uri()],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )
        try:
            answer: Answer = json.loads(received(1800))
        finally:
            browser.kill()
            browser.wait()
    return answer


@contextmanager
def receiving() -> Iterator[tuple[str, Callable[[float], bytes]]]:
    """A server on this machine, and a function that waits for what a page sends it."""
    found: list[bytes] = []
    there = threading.Event()

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            found.append(self.rfile.read(int(self.headers["Content-Length"])))
            self.send_response(204)
            self.end_headers()
            there.set()

        def log_message(self, *args: Any) -> None:
            pass

    def received(seconds: float) -> bytes:
        assert there.wait(seconds), "the page sent nothing"
        return found[0]

    with HTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield f"http://127.0.0.1:{server.server_port}", received
        finally:
            server.shutdown()


HOSTS = {"node": in_node, "chromium": in_chromium}


class Case:
    """A scenario with all our receivers, as a plan for WebAssembly and as native results."""

    def __init__(
        self, scenario: Scenario, receivers: tuple[str, ...], changes: Mapping[str, float] = {}
    ) -> None:
        rng = np.random.default_rng(list(scenario.name.encode()))
        self.seeds = rng.integers(0, 2**31, RUNS)
        self.beacons = scenario.beacons
        self.plan = plans.plan_of(scenario, receivers, settling_ns=5_000_000_000)
        prepared = of_scenario(scenario, receivers)
        components, labels = prepared.system.components, prepared.description.receivers
        seeded = starts.seeded(scenario, components, labels)
        handovers = starts.handovers(scenario, components, labels)

        def executed(seeds: Any, **options: Any) -> native.RunsOutcome:
            return native.execute(
                prepared.plan, {**{f"{name}.seed": seeds for name in seeded}, **changes},
                handovers=handovers, **options,
            )

        self.many = executed(self.seeds, settling_ns=5_000_000_000, percentages=PERCENTAGES)
        columns = [c.name for c in prepared.plan.columns]
        self.record = executed(self.seeds[-1:], record=columns).record(0).values

    def job(self, module: Path, part: int = 4) -> dict[str, Any]:
        return {
            "module": base64.b64encode(module.read_bytes()).decode(),
            "description": json.loads(self.plan.text),
            "content": base64.b64encode(self.plan.content).decode(),
            "seeds": self.seeds.tolist(), "percentages": PERCENTAGES, "workers": WORKERS,
            "part": part, "recorded": int(self.seeds[-1]),
        }

    def compare(self, answer: Answer, counts: Sequence[int] = WORKERS) -> int:
        """Check an answer, with each count of workers; returns how many numbers it has."""
        if "error" in answer:
            pytest.fail(answer["error"])
        count = compared(answer["record"], self.record)
        for workers in (0, *counts):
            found = answer[str(workers)]
            count += compared(found["sums"], self.many.sums)
            count += compared(found["order"], self.many.order)
        return count


def compared(found: Mapping[str, str], expected: Mapping[str, Any]) -> int:
    """Check that numbers are equal to the bit, but for the bits of a NaN."""
    assert found.keys() == expected.keys()
    for name, values in expected.items():
        mine = np.frombuffer(base64.b64decode(found[name]), "<f8").reshape(values.shape)
        np.testing.assert_array_equal(mine, values, err_msg=name)
        zero = values == 0
        np.testing.assert_array_equal(np.signbit(mine[zero]), np.signbit(values[zero]))
    return sum(values.size for values in expected.values())


@cache
def case(name: str, receivers: tuple[str, ...]) -> Case:
    return Case(sblcosim.load(name), receivers)


@pytest.mark.filterwarnings("ignore")  # some receivers are not for some beacons
@pytest.mark.parametrize("lanes", [1, 2])
@pytest.mark.parametrize("host", HOSTS)
@pytest.mark.parametrize("name", few(shipped(), QUICK))
def test_a_module_gives_the_bits_of_the_lanes_master(
    name: str, host: str, lanes: int, tmp_path: Path
) -> None:
    mine = case(name, tuple(RECEIVERS))
    answer = HOSTS[host](mine.job(modules.module((), mine.beacons, lanes)), tmp_path)
    assert mine.compare(answer) > 10_000


SMALL = ("ekf", "multilateration")
"""Receivers of a module that is quickly compiled."""


@pytest.mark.filterwarnings("ignore")
@one_in(2)
@pytest.mark.parametrize("lanes", [1, 2])
def test_other_beacons_intervals_and_start_values(lanes: int, tmp_path: Path) -> None:
    """Six beacons; receivers that are held between updates; a start value that the host changes."""
    changes = {"platform.beacons": 6, "time.ekf_ratio": 4, "time.duration_s": 60.0}
    name = "acoustics.range_std"
    mine = Case(sblcosim.load("realistic-dive", changes), SMALL, {name: 0.75})
    usual = Case(sblcosim.load("realistic-dive", changes), SMALL)
    assert (mine.many.sums["ekf"] != usual.many.sums["ekf"]).any()
    module = modules.module(SMALL, 6, lanes)
    mine.compare(in_node({**mine.job(module), "changes": {name: [0.75]}}, tmp_path))
    usual.compare(in_node(usual.job(module), tmp_path))


def test_a_record_is_that_of_a_run() -> None:
    """The record with a seed is the one that the command line gives for the scenario with it."""
    mine = case("paper-scenario-1", tuple(RECEIVERS))
    run = sblcosim.run(
        sblcosim.load("paper-scenario-1", {"seed": int(mine.seeds[-1])}), tuple(RECEIVERS)
    )
    assert run.record.values.keys() == mine.record.keys()
    for name, values in run.record.values.items():
        np.testing.assert_array_equal(mine.record[name], values, err_msg=name)


@pytest.fixture(scope="module")
def short() -> Case:
    changes = {"time.duration_s": 20.0, "platform.seed": 7}
    return Case(sblcosim.load("harbour-square", changes), SMALL)


def test_results_are_by_seed_not_by_arrival(short: Case, tmp_path: Path) -> None:
    job = short.job(modules.module(SMALL), part=3)
    short.compare(in_node({**job, "late": 300}, tmp_path))


@pytest.mark.parametrize("dying", [[0], [1], [0, 2, 1], [0, 0, 0, 0, 1]])
def test_a_worker_that_dies_loses_nothing(short: Case, dying: list[int], tmp_path: Path) -> None:
    job = {**short.job(modules.module(SMALL), part=2), "workers": [4], "dying": dying}
    short.compare(in_node(job, tmp_path), [4])


@pytest.mark.parametrize("workers", [1, 3])
@pytest.mark.parametrize("hanging", [[0], [0, 2], [0, 0]])
def test_a_worker_that_hangs_loses_nothing(
    short: Case, workers: int, hanging: list[int], tmp_path: Path
) -> None:
    """They loop for ever; on a slow computer, one that does not may be replaced, too."""
    job = {**short.job(modules.module(SMALL), part=2), "workers": [workers], "hanging": hanging,
           "patience": 500}
    answer = in_node(job, tmp_path)
    short.compare(answer, [workers])
    assert answer["started"] > workers


def test_the_time_of_a_worker_follows_from_how_fast_it_is(short: Case, tmp_path: Path) -> None:
    """Ten steps of a tenth of the limit; one that takes 0.3 s for a part gets ten times that."""
    job = {**short.job(modules.module(SMALL), part=2), "workers": [1], "patience": 1, "late": 300,
           "waits": True}
    answer = in_node(job, tmp_path)
    short.compare(answer, [1])
    waits = answer["waits"]
    assert waits[0] == 0.1  # it is being made
    assert max(waits) > 250
    assert waits[2] < max(waits)


@pytest.mark.parametrize(("how", "why"), [("dying", "a worker ended"), ("hanging", "no answer")])
def test_without_workers_that_answer_there_is_an_error(
    short: Case, how: str, why: str, tmp_path: Path
) -> None:
    """Neither of two places has one, with the two that follow each."""
    job = {**short.job(modules.module(SMALL), part=2), "workers": [2], how: [0] * 6}
    if how == "hanging":
        job["patience"] = 100
    assert why in in_node(job, tmp_path)["error"]


def test_only_components_without_a_seed_get_the_run_s(short: Case) -> None:
    names = [c["name"] for c in short.plan.description["components"]]
    assert {names[number] for number, _ in short.plan.description["seeds"]} == {
        "target", "acoustics"
    }


def broken(description: dict[str, Any], how: str) -> dict[str, Any]:
    """A plan that does not fit."""
    return {
        "beacons": {**description, "beacons": 5},
        "component": {**description, "components": [
            {**it, "type": "coupled" if it["type"] == "ekf" else it["type"]}
            for it in description["components"]
        ]},
        "room": {**description, "room": 1},
    }.get(how, description)


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ("beacons", "the plan must be for 4 beacons, got 5"),
        ("component", "a component must be one of target, platform, acoustics, ekf"),
        ("room", "must not give more estimates"),
        ("interval", "acoustics.sampling_time: must be the same in all runs side by side"),
        ("parameter", "acoustics.range: must be a parameter of the plan"),
    ],
)
def test_what_does_not_fit_is_refused(
    short: Case, how: str, words: str, tmp_path: Path
) -> None:
    job = short.job(modules.module(SMALL))
    job["description"] = broken(job["description"], how)
    if how == "interval":
        job["changes"] = {"acoustics.sampling_time": [1.0000000001]}
    if how == "parameter":
        job["changes"] = {"acoustics.range": [1.0]}
    assert words in in_node(job, tmp_path)["error"]


def test_what_python_refuses() -> None:
    with pytest.raises(ConfigurationError, match=r"receivers: each must be one of .*'efk'"):
        modules.module(("efk",))
    with pytest.raises(ConfigurationError, match="lanes: must be 1 or 2 in WebAssembly, got 4"):
        modules.module(SMALL, lanes=4)


MEMORY = """
import { readFileSync } from "node:fs";
import { Engine, Plan } from "./engine.mjs";
import { bytesOf } from "./wasm_host.mjs";
const job = JSON.parse(readFileSync("job.json", "utf8"));
const engine = await Engine.load(bytesOf(job.module).buffer);
const plan = new Plan(job.description, bytesOf(job.content).buffer);
const sizes = [];
for (let n = 0; n < 101; n++) {
  engine.run(plan, Array.from({ length: 1000 }, (_, i) => 1000 * n + i), job.percentages);
  engine.record(plan, n);
  globalThis.gc();
  const { heapUsed, arrayBuffers } = process.memoryUsage();
  sizes.push([engine.wasm.memory.buffer.byteLength, heapUsed + arrayBuffers]);
}
console.log(JSON.stringify(sizes));
"""


@pytest.mark.slow
@pytest.mark.parametrize("lanes", [1, 2])
def test_memory_is_flat_over_a_hundred_thousand_runs(
    short: Case, lanes: int, tmp_path: Path
) -> None:
    if NODE is None:
        pytest.skip("needs node")
    shutil.copy(modules.SCRIPT, tmp_path / "engine.mjs")
    shutil.copy(HOST, tmp_path)
    (tmp_path / "job.json").write_text(json.dumps(short.job(modules.module(SMALL, 4, lanes))))
    (tmp_path / "memory.mjs").write_text(MEMORY)
    done = subprocess.run(
        [NODE, "--expose-gc", "memory.mjs"], cwd=tmp_path, check=True, capture_output=True
    )
    wasm, heap = np.array(json.loads(done.stdout)).T
    assert (wasm[1:] == wasm[1]).all()
    assert heap[-10:].max() - heap[5:15].max() < 500_000


LARGEST = {1: (960_000, 340_000), 2: (1_300_000, 390_000)}
"""Largest size of a module with all our receivers, and compressed [bytes], by lanes."""


@pytest.mark.parametrize("lanes", LARGEST)
def test_sizes(lanes: int) -> None:
    content = modules.module(lanes=lanes).read_bytes()
    raw, packed = LARGEST[lanes]
    assert len(content) <= raw
    assert len(gzip.compress(content, 9)) <= packed
