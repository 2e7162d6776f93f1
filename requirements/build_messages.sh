#!/bin/sh
# Builds packages of message definitions without a ROS: by the generators of Jazzy from wheels.
# `make messages` calls it; the tests of typed messages use the result. With ROS sourced, colcon
# builds them.
#
#   sh requirements/build_messages.sh ENVIRONMENT PREFIX PACKAGE...
#
# ENVIRONMENT holds requirements/messages.txt; PREFIX gets lib/, share/ and include/. It needs
# cmake, make and a C++ compiler (Debian, Ubuntu: apt install cmake build-essential).
set -eu

environment=$(cd "$1" && pwd)
mkdir -p "$2"
prefix=$(cd "$2" && pwd)
shift 2

for tool in cmake make c++; do
    command -v "$tool" >/dev/null && continue
    echo "$tool is not here: apt install cmake build-essential" >&2
    exit 1
done

# The wheels name the folders of the machine on which they were made.
python=$environment/bin/python
headers=$("$python" -c 'import sysconfig; print(sysconfig.get_path("include"))')
arrays=$("$python" -c 'import numpy; print(numpy.get_include())')
find "$environment/share" -name '*Export.cmake' -exec sed -i \
    -e "s#/opt/python/[^\";]*/numpy/[^\";]*#$arrays#g" \
    -e "s#/opt/python/[^\";]*/include/python3[0-9.]*#$headers#g" {} +

export PATH="$environment/bin:$PATH" AMENT_PREFIX_PATH="$environment"
export LD_LIBRARY_PATH="$environment/lib"
for package in "$@"; do
    build=$prefix/build/$(basename "$package")
    cmake -S "$package" -B "$build" -DCMAKE_PREFIX_PATH="$environment" \
        -DCMAKE_INSTALL_PREFIX="$prefix" -DPython3_EXECUTABLE="$python" >/dev/null
    cmake --build "$build" --parallel "$(nproc)" --target install >/dev/null
    echo "$package: built into $prefix"
done
