"""ROS parameters made of the settings: declared, checked, and changed while the node runs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import ParameterException, ParameterUninitializedException
from rclpy.parameter import Parameter

from nanorocks_ros.errors import ConfigurationError, NanorocksError
from nanorocks_ros.nodes.base.communication.qos_overrides import (
    refuse_invalid_overrides,
    refuse_overrides_of_unknown_topics,
)
from nanorocks_ros.nodes.base.parameter_checks import (
    command_line_parameters,
    require_string,
    unknown_parameters,
)
from nanorocks_ros.settings import (
    IN_RANGE,
    SETTINGS_LISTED,
    coerced,
    problem,
    rows,
    with_current_names,
    with_values,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Collection

    from rclpy.node import Node

    from nanorocks_ros.settings import SettingRow

SettingsType = TypeVar('SettingsType')
StagesType = TypeVar('StagesType')

_NEVER_CHANGED = {'trays', 'trays_file'}
CYCLE_GOES_ON = 'the running cycle goes on'
"""What `adopt` of `NodeParameters.react_to_changes` returns where no stage was reset."""
ALL_RESET = 'all stages were reset, the next shaking event starts a cycle'
"""What it returns where all were."""


class NodeParameters:
    """The parameters of a node.

    Parameters
    ----------
    node : rclpy.node.Node

    Raises
    ------
    ConfigurationError
        When an override of a quality of service is invalid.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._rows: dict[str, SettingRow] = {}
        refuse_invalid_overrides(node._parameter_overrides)
        node.add_pre_set_parameters_callback(self._with_own_types)

    def declare(
        self, settings: SettingsType, prefix: str = '', *, read_only: bool = True
    ) -> SettingsType:
        """Declare every setting as a parameter.

        Parameters
        ----------
        settings : dataclass of settings
            The defaults.
        prefix : str
            Of the names of the parameters.
        read_only : bool
            Whether they cannot be changed later; those that choose the trays never can.

        Returns
        -------
        dataclass of settings
            With the values that were given to the node.

        Raises
        ------
        ConfigurationError
            When a value has the wrong type or is out of range.
        """
        where = f'node {self._node.get_name()}'
        given = self._node._parameter_overrides
        self._node._parameter_overrides, warnings = with_current_names(
            settings, given, where, prefix
        )
        for warning in warnings:
            self._node.get_logger().warning(warning)
        values = {
            row.name: self._declare_row(prefix + row.name, row, read_only=read_only)
            for row in rows(settings)
        }
        checked = with_values(settings, values, where)
        self._rows.update({prefix + row.name: row for row in rows(settings)})
        return checked

    def _declare_row(self, name: str, row: SettingRow, *, read_only: bool) -> Any:
        """Declare one setting with a type that never changes; its value."""
        given = self._node._parameter_overrides
        value = list(row.default) if isinstance(row.default, tuple) else row.default
        if name in given:
            value = _converted(given[name].value, row)
        if isinstance(row.default, str) and not row.bounds.choices:
            require_string(name, value)
        kind = _type_of(row)
        if not kind.check(value):
            return value
        descriptor = _descriptor(row, read_only=read_only or row.name in _NEVER_CHANGED)
        try:
            # rclpy cannot tell the type of an empty list. Without a value, none of the node could
            # be dumped: asked for all, it answers with nothing.
            empty = value == []
            self._node.declare_parameter(
                name, kind if empty else value, descriptor, ignore_override=True
            )
            if empty and not descriptor.read_only:
                self._node.set_parameters([Parameter(name, kind, [])])
        except ParameterException as error:
            reason = str(error).split('Reason: ')[-1]
            raise ConfigurationError(f'parameter {name}', reason, IN_RANGE) from error
        return value

    def _with_own_types(self, parameters: list[Parameter]) -> list[Parameter]:
        """The parameters to set in the types that were declared, where their values allow it."""
        return [self._with_own_type(parameter) for parameter in parameters]

    def _with_own_type(self, parameter: Parameter) -> Parameter:
        row = self._rows.get(parameter.name)
        if row is None:
            return parameter
        value, kind = _converted(parameter.value, row), _type_of(row)
        return Parameter(parameter.name, kind, value) if kind.check(value) else parameter

    def _value(self, name: str) -> Any:
        """Value of a parameter; None for a list without elements that was never set."""
        try:
            return self._node.get_parameter(name).value
        except ParameterUninitializedException:
            return None

    def refuse_unknown(self) -> None:
        """Refuse parameters that no node reads, rather than ignore them.

        A file may serve the whole graph, so it may hold parameters of other nodes.

        Raises
        ------
        ConfigurationError
            With the name that comes nearest.
        """
        given = self._node._parameter_overrides
        undeclared = [name for name in given if not self._node.has_parameter(name)]
        problems = unknown_parameters(undeclared, self._rows)
        if problems:
            raise ConfigurationError(
                f'node {self._node.get_name()}',
                '; '.join(problems),
                SETTINGS_LISTED,
            )

    def refuse_overrides_of_unknown_topics(self, later_topics: Collection[str]) -> None:
        """Refuse QoS overrides on the command line of topics that this node does not have.

        To be called when all publishers and subscriptions exist but the later ones.

        Parameters
        ----------
        later_topics : collection of str
            Full names of topics that the node may publish or subscribe to later.

        Raises
        ------
        ConfigurationError
            With the topic that comes nearest.
        """
        given = command_line_parameters().keys() & self._node._parameter_overrides.keys()
        refuse_overrides_of_unknown_topics(given, self._node._parameters, later_topics)

    def react_to_changes(
        self,
        settings: SettingsType,
        build: Callable[[SettingsType], StagesType],
        adopt: Callable[[SettingsType, SettingsType, StagesType], str],
    ) -> None:
        """Build new stages for every later change; keep the old ones when that fails.

        Values that are set again are no change.

        Parameters
        ----------
        settings : dataclass of settings
            That the node has now.
        build : callable
            Makes the stages from settings; raises NanorocksError when it cannot.
        adopt : callable
            Takes the settings before and after, and the stages that `build` made of these; it
            returns what became of the running cycle, for the log.
        """
        proposal: list[tuple[SettingsType, StagesType]] = []
        current = [settings]

        def check(parameters: list[Parameter]) -> SetParametersResult:
            ours = [parameter for parameter in parameters if parameter.name in self._rows]
            try:
                values = {row.name: self._value(row.name) for row in rows(settings)}
                values.update({parameter.name: parameter.value for parameter in ours})
                given = {name: value for name, value in values.items() if value is not None}
                changed = with_values(settings, given, 'parameters')
                # Loading a dump sets every parameter, most of them to the value they have.
                proposal[:] = [] if changed == current[0] else [(changed, build(changed))]
            except NanorocksError as error:
                return SetParametersResult(successful=False, reason=str(error))
            return SetParametersResult(successful=True)

        def apply(parameters: list[Parameter]) -> None:
            # A new publisher declares its quality of service as parameters: not a setting.
            names = [parameter.name for parameter in parameters if parameter.name in self._rows]
            if not names or not proposal:
                return
            changed, stages = proposal.pop()
            before, current[0] = current[0], changed
            consequence = adopt(before, changed, stages)
            self._node.get_logger().info(f'{", ".join(names)} changed; {consequence}')

        self._node.add_on_set_parameters_callback(check)
        self._node.add_post_set_parameters_callback(apply)


def _type_of(row: SettingRow) -> Parameter.Type:
    """The type of the parameter of a setting."""
    if isinstance(row.default, tuple):
        return Parameter.Type.INTEGER_ARRAY if row.bounds.whole else Parameter.Type.DOUBLE_ARRAY
    kind: Parameter.Type = Parameter.Type.from_parameter_value(row.default)
    return kind


def _converted(value: Any, row: SettingRow) -> Any:
    """A value as the parameter holds it: 13500 in a YAML file has to do for 13500.0."""
    if value is None or problem(row, value) is not None:
        return value
    own = coerced(row, value)
    return list(own) if isinstance(own, tuple) else own


def _descriptor(row: SettingRow, *, read_only: bool) -> ParameterDescriptor:
    descriptor = ParameterDescriptor(
        description=f'{row.doc} [{row.unit}]' if row.unit else row.doc,
        additional_constraints=', '.join(row.bounds.choices),
        read_only=read_only,
    )
    low, high = row.bounds.low, row.bounds.high
    if isinstance(row.default, float):
        descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
    elif isinstance(row.default, int) and not isinstance(row.default, bool):
        descriptor.integer_range = [IntegerRange(from_value=int(low), to_value=int(high))]
    return descriptor
