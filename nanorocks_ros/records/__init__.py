"""What passes between the stages: frozen values, SI units, one integer time stamp each.

Estimates carry ``_error``, one standard error. NaN means "not known yet", never 0.
"""

from nanorocks_ros.records.bead_tracks import Tracks
from nanorocks_ros.records.cluster_estimates import (
    Autocorrelation,
    BodyEstimate,
    ClusterEstimate,
    Merge,
)
from nanorocks_ros.records.contact_records import PairCollision, Rebound
from nanorocks_ros.records.frames import Frame, MotionMask, Notice, TrayImage, TrayState
from nanorocks_ros.records.quality_flags import (
    NOTHING_WRONG,
    UNKNOWN,
    CorRelation,
    CorStatus,
    Quality,
    SizeStatus,
    SpeedMethod,
    StickingStatus,
    field_names,
    freeze_arrays,
)
from nanorocks_ros.records.restitution_estimates import CorEstimate
from nanorocks_ros.records.simulation_truth import BeadsTruth, GroundTruth
from nanorocks_ros.records.speed_estimates import SpeedEstimate

__all__ = [
    'NOTHING_WRONG',
    'UNKNOWN',
    'Autocorrelation',
    'BeadsTruth',
    'BodyEstimate',
    'ClusterEstimate',
    'CorEstimate',
    'CorRelation',
    'CorStatus',
    'Frame',
    'GroundTruth',
    'Merge',
    'MotionMask',
    'Notice',
    'PairCollision',
    'Quality',
    'Rebound',
    'SizeStatus',
    'SpeedEstimate',
    'SpeedMethod',
    'StickingStatus',
    'Tracks',
    'TrayImage',
    'TrayState',
    'field_names',
    'freeze_arrays',
]
