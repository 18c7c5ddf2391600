"""The page of the examples that runs a component, in a real browser, without a network.

Skipped where there is no Chromium or zig.
"""

from __future__ import annotations

import html
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import BROWSER, dumped
from fmpy import simulate_fmu
from sblcosim.fmus.build import compiler, factory

pytestmark = [
    pytest.mark.skipif(BROWSER is None, reason="needs Chromium"),
    pytest.mark.skipif(compiler.zig() is None, reason="needs ziglang"),
]
PAGE = Path(__file__).parents[2] / "examples" / "wasm.html"
STEPS, STEP = 20, 0.1
PROBE = """<!DOCTYPE html><title>probe</title><pre id="found"></pre>
<iframe id="page" src="wasm.html"></iframe>
<script>
addEventListener("load", async () => {
  const d = document.getElementById("page").contentWindow;
  const bytes = await (await new Promise(done => {
    const request = new XMLHttpRequest();
    request.open("GET", "some.fmu"); request.responseType = "blob";
    request.onload = () => done(request.response); request.send();
  }));
  const given = new d.DataTransfer();
  given.items.add(new d.File([bytes], "some.fmu"));
  d.fmu.files = given.files;
  d.fmu.dispatchEvent(new d.Event("change", { bubbles: true }));
  const table = d.document.getElementById("table");
  const wait = () => table.textContent
    ? document.getElementById("found").textContent = table.textContent : setTimeout(wait, 20);
  wait();
});
</script>
"""


def shown(fmu: Path, folder: Path) -> str:
    """What the page shows of an FMU."""
    shutil.copy(fmu, folder / "some.fmu")
    shutil.copy(PAGE, folder / "wasm.html")
    (folder / "probe.html").write_text(PROBE)
    dom, complaints = dumped(folder, folder / "probe.html")
    found = re.search(r'<pre id="found">(.*?)</pre>', dom, re.S)
    assert found, complaints
    return html.unescape(found[1])


@pytest.mark.parametrize("fmi", [2, 3])
def test_the_page_shows_the_numbers_of_the_fmu(fmi: Any, tmp_path: Path) -> None:
    assert len(PAGE.read_text().splitlines()) <= 60
    (fmu,) = factory.build_all([factory.Wanted("target", fmi, wasm=True)])
    head, *rows = (line.split("\t") for line in shown(fmu, tmp_path).splitlines())
    names = ["position[1]", "position[2]", "position[3]"] if fmi == 2 else ["position"]
    expected = simulate_fmu(
        str(fmu), stop_time=STEPS * STEP, step_size=STEP, output_interval=STEP, output=names
    )
    first = head.index(names[0])
    found = np.array([[float(x) for x in row[first:first + 3]] for row in rows])
    asked = [np.asarray(expected[name]).reshape(STEPS + 1, -1) for name in names]
    np.testing.assert_array_equal(found, np.concatenate(asked, axis=1))
    assert len(np.unique(found[:, 0])) > STEPS // 2


def test_the_page_says_what_an_fmu_lacks(tmp_path: Path) -> None:
    text = shown(factory.build("range_model", 3), tmp_path)
    assert text == "the FMU must be built with --platform wasm32"
