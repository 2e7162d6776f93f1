#!/bin/sh
# Makes the source distribution, the wheel from it, and an environment that has nothing but the
# wheel and what it requires: no ROS, no source tree. `make test-package` calls it:
#
#   sh requirements/test_package.sh PYTHON FOLDER
#
# PYTHON has setuptools; FOLDER is made anew. Versions are those of the lock file.
set -eu
unset PYTHONPATH AMENT_PREFIX_PATH PYTHONHOME || true
python=$1
folder=$2
root=$PWD

rm -rf "$folder"
mkdir -p "$folder"
folder=$(cd "$folder" && pwd)
log=$folder/log

logged() {
    doing=$1
    shift
    "$@" >>"$log" 2>&1 && return
    tail -n 15 "$log" >&2
    echo "$folder: could not $doing; the lines above end $log" >&2
    exit 1
}

echo "$folder: making the source distribution, and the wheel from it"
logged 'make the source distribution' "$python" -c \
    "from setuptools import build_meta; build_meta.build_sdist('$folder/dist')"
logged 'make the wheel' "$python" -m pip wheel --no-deps --no-build-isolation \
    --wheel-dir "$folder/dist" "$folder"/dist/*.tar.gz

"$python" - "$folder"/dist/*.whl <<'CHECK'
"""Every file of the package is in the wheel, and nothing else is importable from it."""
import sys
import zipfile
from pathlib import Path

inside = {name for name in zipfile.ZipFile(sys.argv[1]).namelist() if not name.endswith('/')}
source = {
    path.as_posix()
    for path in Path('nanorocks_ros').rglob('*')
    if path.is_file() and '__pycache__' not in path.parts and path.suffix not in ('.nbi', '.nbc')
}
missing = source - inside
foreign = {name for name in inside if name.split('/')[0] != 'nanorocks_ros'}
foreign = {name for name in foreign if '.data/' not in name and '.dist-info/' not in name}
if missing or foreign:
    sys.exit(f'{sys.argv[1]}: lacks {sorted(missing)}, has {sorted(foreign)}')
CHECK

echo "$folder: installing the wheel alone"
logged 'make the environment' "$python" -m venv "$folder/venv"
# The versions of the lock file, without its hashes: the wheel made here has none.
sed -n 's/^\([a-z0-9._-]*==[^\\]*[^ \\]\).*/\1/p' requirements/wheels.txt >"$folder/versions.txt"
logged 'install the wheel' "$folder/venv/bin/python" -m pip --disable-pip-version-check install \
    --no-compile --only-binary :all: --constraint "$folder/versions.txt" "$folder"/dist/*.whl

PATH=$folder/venv/bin:/usr/bin:/bin
export PATH
mkdir "$folder/work"
cd "$folder/work"
python - <<'CHECK'
"""The package comes from the wheel, is typed, and there is no ROS."""
from importlib import resources
from importlib.util import find_spec
from pathlib import Path
import sys

import nanorocks_ros

assert Path(nanorocks_ros.__file__).is_relative_to(sys.prefix), nanorocks_ros.__file__
assert resources.files('nanorocks_ros').joinpath('py.typed').is_file()
assert find_spec('rclpy') is None, 'rclpy can be imported'
CHECK
set -x
nanorocks --version
nanorocks completion bash >completion.bash
# At the first start each compiles other functions for most of a minute.
nanorocks analyse "$root/bags/tray_1_sample" -o results &
analysis=$!
nanorocks simulate --tray 1 --duration 2 --video film.mp4 >simulate.txt
nanorocks info film.mp4
wait "$analysis"
