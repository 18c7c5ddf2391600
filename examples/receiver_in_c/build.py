"""Build the receiver in C as an FMU for this machine.

    pip install fmpy                (it includes the FMI headers)
    pip install ziglang             (if there is no C compiler, cc)
    python examples/receiver_in_c/build.py receiver.fmu
    sblcosim check receiver.fmu
    sblcosim run paper-scenario-1 --receiver ekf --receiver receiver.fmu
"""

import shutil
import subprocess
import sys
import zipfile
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

try:
    import fmpy
except ImportError:
    sys.exit("this example needs FMPy: pip install fmpy")

HERE = Path(__file__).parent


def build(fmu):
    """Write the FMU to the file `fmu`."""
    if shutil.which("cc"):
        compiler = ["cc"]
    elif find_spec("ziglang"):
        compiler = [sys.executable, "-m", "ziglang", "cc"]
    else:
        sys.exit("this example needs a C compiler: cc, or pip install ziglang")
    headers = Path(fmpy.__file__).parent / "c-code"
    with TemporaryDirectory() as folder:
        library = Path(folder, f"receiver{fmpy.sharedLibraryExtension}")
        command = [*compiler, "-shared", "-fPIC", "-O2", f"-I{headers}", HERE / "receiver.c", "-lm"]
        subprocess.run([*command, "-o", library], check=True)
        with zipfile.ZipFile(fmu, "w") as archive:
            archive.write(HERE / "modelDescription.xml", "modelDescription.xml")
            archive.write(library, f"binaries/{fmpy.platform}/{library.name}")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python examples/receiver_in_c/build.py RECEIVER.fmu")
    try:
        build(sys.argv[1])
    except OSError as error:
        sys.exit(f"{sys.argv[1]}: must be writable, got {error}")
