#!/bin/sh
# Makes a virtual environment as a lock file says and installs this package into it; returns at
# once when there is nothing to do. `make` calls it:
#
#   sh requirements/set_up.sh FOLDER LOCK [own|system] [dependencies|compile]
#
# `system` lets the environment see the Python packages of the ROS 2 that is sourced; with
# `dependencies` this package is not installed yet, which two calls must not do at a time; with
# `compile` its functions are compiled after an installation, so that no first start does so.
# $PYTHON names the interpreter; without it the first that runs and is new enough is taken.
set -eu
unset _ROS_WHEELS_BOOTSTRAP_COMPLETE PYTHONHOME

folder=$1
lock=$2
kind=${3:-own}
log=$folder/set_up.log
[ "$kind" = system ] || unset PYTHONPATH

fail() {
    echo "$*" >&2
    exit 1
}

probe='
import sys
if sys.version_info < (3, 10):
    sys.exit(3)
if sys.argv[1] == "system":
    try:
        import rclpy, std_msgs.msg
    except ImportError:
        sys.exit(4)
try:
    import ensurepip, venv
except ImportError:
    print("%d.%d" % sys.version_info[:2])
    sys.exit(5)
print(getattr(sys, "_base_executable", None) or sys.executable)
'

find_python() {
    if [ -n "${PYTHON:-}" ]; then
        set -- "$PYTHON"
    else
        set -- python3 python3.13 python3.12 python3.11 python3.10 /usr/bin/python3
    fi
    # Run them: a command that is there need not work (the shims of pyenv, a removed library).
    without_rclpy= without_venv=
    for candidate in "$@"; do
        status=0
        found=$("$candidate" -c "$probe" "$kind" 2>/dev/null) || status=$?
        case $status in
            0) interpreter=$found; return ;;
            4) without_rclpy=$candidate ;;
            5) without_venv="$candidate (Python $found)" ;;
        esac
    done
    if [ -n "$without_venv" ]; then
        fail "$without_venv lacks the modules venv and ensurepip: install them (Debian, Ubuntu:" \
            "apt install python3-venv) or name another with make PYTHON=/path/to/python3"
    elif [ -n "$without_rclpy" ]; then
        fail "ROS 2 Jazzy is sourced, but no Python here imports its rclpy and std_msgs: install" \
            "ros-jazzy-ros-base, name the Python with make PYTHON=..., or use a shell without ROS"
    elif [ -n "${PYTHON:-}" ]; then
        fail "PYTHON=$PYTHON does not run as Python 3.10 or newer: name another, or none"
    fi
    fail "no Python 3.10 or newer that runs: install one (Debian, Ubuntu: apt install python3" \
        "python3-venv) or name it with make PYTHON=/path/to/python3"
}

logged() {
    doing=$1
    shift
    "$@" >>"$log" 2>&1 && return
    grep -v '^ *$' "$log" | tail -n 15 >&2
    fail "$folder: could not $doing; the lines above end $log; run make again to try again"
}

pip_install() {
    "$folder/bin/python" -m pip --disable-pip-version-check --no-input install \
        --no-build-isolation --no-compile "$@"
}

stored() { cat "$folder/$1" 2>/dev/null || true; }

# Without $PYTHON an environment that works keeps the interpreter it was made with.
interpreter=$(stored interpreter)
if [ -n "${PYTHON:-}" ] || [ -z "$interpreter" ] || ! "$folder/bin/python" -ISc '' 2>/dev/null; then
    find_python
fi

wanted=$({ cat "$lock" "$0"; echo "$PWD $interpreter $kind"; } | cksum)
if [ "$(stored dependencies)" != "$wanted" ]; then
    version=$("$interpreter" -c 'import platform; print(platform.python_version())')
    echo "$folder: Python $version, installing $lock (a minute or two, the first time)"
    rm -rf "$folder"
    mkdir "$folder"
    options=
    [ "$kind" = own ] || options=--system-site-packages
    # shellcheck disable=SC2086  # empty, or one word
    logged 'make the environment' "$interpreter" -m venv $options "$folder"
    # Builds what comes as source (empy, lark-parser), as locked.
    # The lines of setuptools in the lock file, with its hashes.
    awk '/^setuptools==/ { on = 1 } on { print; if (!/\\$/) exit }' "$lock" >"$folder/setuptools.txt"
    logged 'install setuptools' pip_install --require-hashes -r "$folder/setuptools.txt"
    # The lock file names everything, so nothing is resolved: pip before 23.3 takes the newest
    # release of `coverage[toml]`, beside the locked one of `coverage`, and stops at its hash.
    logged "install $lock" pip_install --require-hashes --use-pep517 --no-deps -r "$lock"
    # pip would keep one processor busy with it; what is for tests alone compiles what it imports.
    # Templates of some packages are no Python.
    [ "${4:-}" = dependencies ] ||
        "$folder/bin/python" -m compileall -q -j 0 "$folder/lib" >>"$log" 2>&1 || true
    echo "$interpreter" >"$folder/interpreter"
    echo "$wanted" >"$folder/dependencies"
fi
[ "${4:-}" != dependencies ] || exit 0

# The code itself runs from the source tree; copied are the metadata and what goes to lib/ and share/.
installed='setup.py setup.cfg pyproject.toml package.xml nanorocks_ros/__init__.py resource scripts launch config foxglove rviz plotjuggler'
# shellcheck disable=SC2086  # a list of words
wanted=$(find $installed ! -type d | LC_ALL=C sort | xargs cksum)
if [ "$(stored package)" != "$wanted" ] || [ ! -d "$folder/lib/nanorocks_ros" ]; then
    echo "$folder: installing nanorocks_ros"
    logged 'install nanorocks_ros' pip_install --no-deps --editable .
    echo "$wanted" >"$folder/package"
    if [ "${4:-}" = compile ]; then
        echo "$folder: compiling functions, on all cores (a minute; once for this state of the code)"
        # Whatever is not compiled now is at its first use.
        "$folder/bin/nanorocks" compile || true
    fi
fi
