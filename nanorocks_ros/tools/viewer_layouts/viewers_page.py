"""The page on viewers: each number of an element in it is looked up by name."""

from __future__ import annotations

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.tools.viewer_layouts.charts import (
    CHARTS,
    PICTURES,
    element,
    message_path,
    series,
)
from nanorocks_ros.wire import topics

_TRAY = 1
_SHARE = 'share/nanorocks_ros'
_INTRODUCTION = """# Viewers

What the nodes publish can be drawn by any viewer that knows ROS 2. Layouts for three of them are
installed into `{share}`; all are made from the message definitions, so that an element never
stands for another.

| viewer | layout | shows |
| --- | --- | --- |
| [Foxglove](https://foxglove.dev), \
[Lichtblick](https://github.com/lichtblick-suite/lichtblick) \
| `foxglove/nanorocks.json` \
| pictures, plots and diagnostics: a tab for the plate, and one for each tray |
| RViz 2 | `rviz/nanorocks.rviz` | pictures: camera, tracks, motion, autocorrelation |
| PlotJuggler | `plotjuggler/nanorocks.xml` | plots: a tab for each tray |
| rqt_plot, `ros2 topic echo` | none needed | single elements |

An estimate is a `std_msgs/Float32MultiArray`, so viewers name its elements by number. Of
`{cor}`, for instance, element {restitution} is the restitution of the beads, {lower} and {upper}
are the ends of its interval. [topics.md](../reference/topics.md#array-layouts) lists all.

Where the package lies: `ros2 pkg prefix --share nanorocks_ros`, or with the wheels
`$VIRTUAL_ENV/{share}`. The viewer has to be on the same ROS domain, and with
`ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST` on the same machine; `nanorocks doctor --graph` tells
who does not hear whom.

"""
_FOXGLOVE = """## Foxglove and Lichtblick

![The tab of tray 1: tracks, motion, autocorrelation; speed, restitution with its interval, \
clusters and sticking speed]\
(../pictures/viewers_foxglove.png)

The tab of tray 1 in Lichtblick 1.28, with what `pipeline` made of `bags/tray_1_sample`.

A recording needs no ROS: open the bag's `.mcap`, or that of the results, with *Open local file*,
then *Layouts, Import from file*, `foxglove/nanorocks.json`. `nanorocks analyse BAG` writes the
results bag beside the input; both together are opened by choosing both files.

A running graph is reached through `foxglove_bridge` (`sudo apt install
ros-jazzy-foxglove-bridge`):

    ros2 launch foxglove_bridge foxglove_bridge_launch.xml address:=127.0.0.1

then *Open connection*, `ws://localhost:8765`. The pictures of a tray are built only while its
tab is open.

By hand: add a panel *Plot* and in it the series

{paths}
The horizontal axis is when a message came. For the instant that was measured choose *Custom* as
X axis, with the path `{time}`: element 0 of every array is its time.

"""
_RVIZ = """## RViz 2

    rviz2 -d $(ros2 pkg prefix --share nanorocks_ros)/rviz/nanorocks.rviz

Tick a tray to see its pictures. They are asked for as they are offered, reliable: best effort
loses most frames of 1080p. RViz draws no arrays; its pictures are

{pictures}
"""
_PLOTJUGGLER = """## PlotJuggler

    ros2 run plotjuggler plotjuggler \\
      -l $(ros2 pkg prefix --share nanorocks_ros)/plotjuggler/nanorocks.xml

Start the graph first, and the streamer *ROS2 Topic Subscriber* from the list on the left: the
layout ticks its topics. Curves of trays that are not there are named in one warning, and left
out. By hand: drag

{series}
into a plot. For one against another, such as restitution against measured time, select both and
drag with the right button.

"""
_RQT = """## rqt_plot

    ros2 run rqt_plot rqt_plot {plot}

## On the command line

The last estimate is latched: who asks late still gets it.

    ros2 topic echo --qos-durability transient_local {cor} --field data

and with the names of its elements, once:

    ros2 topic echo --qos-durability transient_local --once {cor}

The wheels bring no `ros2` command; a bag of results can be read without it:

    nanorocks analyse bags/tray_1_sample --json --no-output

## Every element that the layouts draw

{table}"""


def _bullets(lines: list[str]) -> str:
    return ''.join(f'- {line}\n' for line in lines)


def _table() -> str:
    rows = [
        f'| {chart.title} | {curve.label} | `{curve.topic.of(_TRAY)}` | `{curve.field}` '
        f'| {element(curve.topic, curve.field)} |\n'
        for chart in CHARTS
        for curve in chart.curves
    ]
    head = '| plot | curve | topic | field | element |\n| --- | --- | --- | --- | --- |\n'
    return head + ''.join(rows)


def viewers_page() -> str:
    """How to plot what is published, in each viewer."""
    cor = topics.COR.absolute(_TRAY)
    restitution = [
        curve for chart in CHARTS for curve in chart.curves if curve.topic is topics.COR
    ]
    first = restitution[:3]
    pictures = [f'`{picture.absolute(_TRAY)}`: {picture.doc}' for picture in PICTURES]
    return (
        _INTRODUCTION.format(
            share=_SHARE,
            cor=cor,
            restitution=element(topics.COR, 'restitution'),
            lower=element(topics.COR, 'restitution_lower'),
            upper=element(topics.COR, 'restitution_upper'),
        )
        + _FOXGLOVE.format(
            paths=_bullets([f'`{message_path(_TRAY, curve)}`: {curve.label}' for curve in first]),
            time=f'{cor}.data[{element(topics.COR, "time")}]',
        )
        + _RVIZ.format(
            pictures=_bullets([f'{one}; trays 1 to {max(load_trays())}' for one in pictures])
        )
        + _PLOTJUGGLER.format(
            series=_bullets([f'`{series(_TRAY, curve)}`: {curve.label}' for curve in first])
        )
        + _RQT.format(
            plot=' '.join(series(_TRAY, curve) for curve in first), cor=cor, table=_table()
        )
    )
