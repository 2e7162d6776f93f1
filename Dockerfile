# The offline commands and the ROS 2 nodes of nanorocks_ros, on ROS 2 Jazzy.
#
# This file was not built where it was written, which had no Docker: it was written with care, by
# the steps of docs/start/guide.md and docs/use/commands.md that are tested without it.
#
#   docker build --tag nanorocks .
#   docker run --rm --volume "$PWD:/data" nanorocks nanorocks measure film.mp4 --diameter-px 31 -o out
#   docker run --rm --network host nanorocks ros2 run nanorocks_ros pipeline
#
# For files of another user than 1000: docker build --build-arg UID="$(id -u)" ...
ARG ROS_DISTRO=jazzy
FROM ros:${ROS_DISTRO}-ros-base

RUN apt-get update \
    && apt-get install --yes --no-install-recommends make python3-venv \
    && rm -rf /var/lib/apt/lists/*

# Images of Ubuntu 24.04 have a user 1000 already, `ubuntu`.
ARG UID=1000
ARG USER=nanorocks
RUN if getent passwd "${UID}" >/dev/null; then userdel --remove "$(getent passwd "${UID}" | cut -d: -f1)"; fi \
    && useradd --create-home --uid "${UID}" --shell /bin/bash "${USER}"

COPY --chown=${UID} . /opt/nanorocks_ros
WORKDIR /opt/nanorocks_ros
RUN chown "${UID}" /opt/nanorocks_ros
USER ${USER}
# Functions are compiled while the image is built, for any processor of this architecture: those for
# the one that builds it would not be found on another, and be compiled again in every container.
# Results are the same bit by bit; analyses take 6 % longer. To compile for the processor at hand,
# remove the line, and start containers with a volume at /home/nanorocks/.cache.
ENV NUMBA_CPU_NAME=generic
# Beside the sourced Jazzy: the environment is .venv-jazzy, of versions in requirements/jazzy.txt.
RUN bash -c 'source /opt/ros/${ROS_DISTRO}/setup.bash && make venv'

ENV PATH=/opt/nanorocks_ros/.venv-jazzy/bin:${PATH} \
    VIRTUAL_ENV=/opt/nanorocks_ros/.venv-jazzy
WORKDIR /data
# The entry point of the base image sources ROS; this one finds the nodes as well.
ENTRYPOINT ["/opt/nanorocks_ros/.devcontainer/entrypoint"]
CMD ["nanorocks", "--help"]
