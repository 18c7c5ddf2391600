#!/usr/bin/env bash
# The FMUs on Windows (Debian's wine64) and ARM (qemu-user) against this machine, bit for bit.
# Run it in the environment of the tests; as root, it installs what is missing.
set -euo pipefail
cd "$(dirname "$0")/../.."
export PATH="$PATH:/usr/lib/wine"
missing=()
command -v wine64 >/dev/null || missing+=(wine64)
command -v qemu-aarch64 >/dev/null || missing+=(qemu-user)
[ -d /usr/aarch64-linux-gnu/lib ] || missing+=(libc6-arm64-cross)
if [ ${#missing[@]} -gt 0 ]; then
    apt-get update && apt-get install --yes --no-install-recommends "${missing[@]}"
fi
exec python -m pytest -m slow -rP -v tests/platforms "$@"
