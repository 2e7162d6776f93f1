"""The records that pass between stages: frozen, SI units, one integer time stamp each.

Errors are one standard error. NaN means "not known yet", never 0.
"""

from nanorocks_ros.records.array_record import ArrayRecord as ArrayRecord
from nanorocks_ros.records.array_record import RecordType as RecordType
from nanorocks_ros.records.bead_tracks import BEAD_FIELDS as BEAD_FIELDS
from nanorocks_ros.records.bead_tracks import Tracks as Tracks
from nanorocks_ros.records.cluster_estimates import Autocorrelation as Autocorrelation
from nanorocks_ros.records.cluster_estimates import BodyEstimate as BodyEstimate
from nanorocks_ros.records.cluster_estimates import ClusterEstimate as ClusterEstimate
from nanorocks_ros.records.cluster_estimates import Merge as Merge
from nanorocks_ros.records.cluster_estimates import sizes_disagree as sizes_disagree
from nanorocks_ros.records.contact_records import WALL_NAMES as WALL_NAMES
from nanorocks_ros.records.contact_records import Contact as Contact
from nanorocks_ros.records.contact_records import ContactOrFlight as ContactOrFlight
from nanorocks_ros.records.contact_records import FreeFlight as FreeFlight
from nanorocks_ros.records.contact_records import PairCollision as PairCollision
from nanorocks_ros.records.contact_records import Rebound as Rebound
from nanorocks_ros.records.frames import NS as NS
from nanorocks_ros.records.frames import Frame as Frame
from nanorocks_ros.records.frames import MotionMask as MotionMask
from nanorocks_ros.records.frames import Notice as Notice
from nanorocks_ros.records.frames import TrayImage as TrayImage
from nanorocks_ros.records.frames import TrayState as TrayState
from nanorocks_ros.records.headlines import AGREEMENT_TENSION as AGREEMENT_TENSION
from nanorocks_ros.records.headlines import Headline as Headline
from nanorocks_ros.records.headlines import headline_in_words as headline_in_words
from nanorocks_ros.records.headlines import headline_of as headline_of
from nanorocks_ros.records.headlines import walls_rub as walls_rub
from nanorocks_ros.records.quality_flags import NOTHING_WRONG as NOTHING_WRONG
from nanorocks_ros.records.quality_flags import UNKNOWN as UNKNOWN
from nanorocks_ros.records.quality_flags import CorRelation as CorRelation
from nanorocks_ros.records.quality_flags import CorStatus as CorStatus
from nanorocks_ros.records.quality_flags import Quality as Quality
from nanorocks_ros.records.quality_flags import SizeStatus as SizeStatus
from nanorocks_ros.records.quality_flags import SpeedMethod as SpeedMethod
from nanorocks_ros.records.quality_flags import StickingStatus as StickingStatus
from nanorocks_ros.records.quality_flags import field_names as field_names
from nanorocks_ros.records.quality_flags import freeze_arrays as freeze_arrays
from nanorocks_ros.records.restitution_estimates import CorEstimate as CorEstimate
from nanorocks_ros.records.simulation_truth import BeadsTruth as BeadsTruth
from nanorocks_ros.records.simulation_truth import GroundTruth as GroundTruth
from nanorocks_ros.records.speed_estimates import SpeedEstimate as SpeedEstimate
from nanorocks_ros.records.values import ONE_SIGMA as ONE_SIGMA
from nanorocks_ros.records.values import UNKNOWN_INTERVAL as UNKNOWN_INTERVAL
from nanorocks_ros.records.values import UNKNOWN_MEASURED as UNKNOWN_MEASURED
from nanorocks_ros.records.values import UNKNOWN_MEASURED_INTERVAL as UNKNOWN_MEASURED_INTERVAL
from nanorocks_ros.records.values import Interval as Interval
from nanorocks_ros.records.values import Measured as Measured
from nanorocks_ros.records.values import MeasuredInterval as MeasuredInterval
