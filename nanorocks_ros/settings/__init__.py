"""Settings: every number a user may change, one frozen dataclass per stage, one field per number.

Each field defines the ROS parameter with its range, the command-line flag and the row in the
documentation. Defaults are written nowhere else.
"""

from nanorocks_ros.settings.graph_settings import (
    BagSettings,
    CameraSettings,
    DashboardGraphSettings,
    DashboardSettings,
    LivePageSettings,
    PacingSettings,
    PlayerSettings,
    RecordSettings,
    SourceSettings,
    WorkSettings,
)
from nanorocks_ros.settings.pipeline_settings import (
    BodySettings,
    ClusterSettings,
    PipelineSettings,
    PreprocessSettings,
    SpeedSettings,
    TrackingSettings,
)
from nanorocks_ros.settings.prior_words import priors_in_words
from nanorocks_ros.settings.restitution_settings import (
    CoolingSettings,
    PriorSettings,
    StickingSettings,
)
from nanorocks_ros.settings.scene_settings import (
    CompressionSettings,
    SceneFilmSettings,
    SceneSettings,
)
from nanorocks_ros.settings.setting_fields import (
    IN_RANGE,
    SETTINGS_LISTED,
    Bounds,
    Scalar,
    SettingRow,
    SettingsType,
    Value,
    coerced,
    problem,
    rows,
    setting,
    with_current_names,
    with_values,
)
from nanorocks_ros.settings.simulation_settings import FilmSettings, SimulationSettings

__all__ = [
    'IN_RANGE',
    'SETTINGS_LISTED',
    'BagSettings',
    'BodySettings',
    'Bounds',
    'CameraSettings',
    'ClusterSettings',
    'CompressionSettings',
    'CoolingSettings',
    'DashboardGraphSettings',
    'DashboardSettings',
    'FilmSettings',
    'LivePageSettings',
    'PacingSettings',
    'PipelineSettings',
    'PlayerSettings',
    'PreprocessSettings',
    'PriorSettings',
    'RecordSettings',
    'Scalar',
    'SceneFilmSettings',
    'SceneSettings',
    'SettingRow',
    'SettingsType',
    'SimulationSettings',
    'SourceSettings',
    'SpeedSettings',
    'StickingSettings',
    'TrackingSettings',
    'Value',
    'WorkSettings',
    'coerced',
    'priors_in_words',
    'problem',
    'rows',
    'setting',
    'with_current_names',
    'with_values',
]
