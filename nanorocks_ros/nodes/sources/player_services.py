"""The services of the bag player: names of `ros2 bag play` and, where installed, its types."""

from __future__ import annotations

from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any

from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from nanorocks_ros.nodes.base.communication.ros_messages import stamp_of

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from types import ModuleType

    from rclpy.node import Node

    from nanorocks_ros.nodes.sources.play_range import PlayRange
    from nanorocks_ros.nodes.sources.player import Player

    Answer = Mapping[str, bool | float | int]
    """The fields of a response."""


def rosbag2_services() -> ModuleType | None:
    """The service types of `ros2 bag play`; None where rosbag2_interfaces is not installed."""
    try:
        return import_module('rosbag2_interfaces.srv')
    except ImportError:
        return None


class PlayerServices:
    """Offers the services of a player.

    With rosbag2_interfaces they are those of `ros2 bag play`. Without it the five that need no
    request are of type std_srvs/srv/Trigger, and parameters do the rest.

    Parameters
    ----------
    node : rclpy.node.Node
        Its parameters `rate` and `position` are what `set_rate` and `seek` set.
    player : Player
    play_range : PlayRange
    is_step : callable
        Whether `play_next` ends with a message.
    """

    def __init__(
        self,
        node: Node,
        player: Player,
        play_range: PlayRange,
        is_step: Callable[[Any], bool],
    ) -> None:
        self._node, self._player, self._range = node, player, play_range
        self._is_step = is_step
        simple: dict[str, Callable[[Any], Answer]] = {
            'pause': self._pause,
            'resume': self._resume,
            'toggle_paused': self._toggle_paused,
            'is_paused': lambda _: {'paused': player.paused},
            'play_next': self._play_next,
        }
        types = rosbag2_services()
        if types is None:
            for name, action in simple.items():
                node.create_service(Trigger, f'~/{name}', partial(self._answer_trigger, action))
            return
        more: dict[str, Callable[[Any], Answer]] = {
            'seek': self._seek,
            'get_rate': lambda _: {'rate': player.rate},
            'set_rate': lambda request: self._set('rate', request.rate),
            'burst': self._burst,
        }
        for name, action in (simple | more).items():
            service_type = getattr(types, name.title().replace('_', ''))
            node.create_service(service_type, f'~/{name}', partial(_answer, action))

    def _answer_trigger(
        self, action: Callable[[Any], Answer], request: object, response: Trigger.Response
    ) -> Trigger.Response:
        """The outcome as `success`, with state and position in words."""
        response.success = bool(next(iter(action(request).values()), True))
        position = f'{self._range.seconds(self._player.now_ns):.3f} s'
        response.message = f'{"paused" if self._player.paused else "playing"} at {position}'
        return response

    def _pause(self, _: object) -> Answer:
        self._player.pause()
        return {}

    def _resume(self, _: object) -> Answer:
        self._player.resume()
        return {}

    def _toggle_paused(self, request: object) -> Answer:
        return self._resume(request) if self._player.paused else self._pause(request)

    def _play_next(self, _: object) -> Answer:
        """Play, while paused, up to the next frame; the next message without a camera."""
        return {'success': self._player.paused and self._player.step(self._is_step)}

    def _burst(self, request: Any) -> Answer:
        """Play some messages at once while paused; 0: to the end."""
        played = 0
        if self._player.paused:
            while played < request.num_messages or request.num_messages == 0:
                if not self._player.step(lambda message: message is not None):
                    break
                played += 1
        return {'actually_burst': played}

    def _seek(self, request: Any) -> Answer:
        return self._set('position', self._range.seconds(stamp_of(request.time)))

    def _set(self, name: str, value: float) -> Answer:
        """Set a parameter of the node, which checks it."""
        parameter = Parameter(name, Parameter.Type.DOUBLE, float(value))
        return {'success': bool(self._node.set_parameters([parameter])[0].successful)}


def _answer(action: Callable[[Any], Answer], request: Any, response: Any) -> Any:
    for field, value in action(request).items():
        setattr(response, field, value)
    return response
