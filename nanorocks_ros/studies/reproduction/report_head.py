"""What the report says before its chapters: how it was made, its conclusion, and its limits.

Tested by ``test/studies/reproduction/test_reproduce_paper.py``.
"""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING

from nanorocks_ros.outputs.html_report import Section, Table, made_line

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from nanorocks_ros.studies.reproduction.campaign_plan import CampaignPlan
    from nanorocks_ros.studies.reproduction.chapters.chapter_context import Chapter

_LIMITS = (
    ('All values of the flight', 'The 178 films of the flight are not published. Simulated films '
     'test the methods, not the beads: an agreement of a value with the paper is no evidence.'),
    ('Restitutions, sticking speed and strength of the shaking in flight',
     'They are what the paper measures. The campaign assumes them; the paper gives the strength '
     'for tray 1 alone.'),
    ('Figure 1a, and the hardware in general', 'A photograph.'),
    ('Manual tracks (Figures 2 and 6, calibrations)', 'Nobody marks beads here: true speeds of '
     'ten beads of each kind take their place, without the preference for fast beads that the '
     'paper names as the bias of its manual tracks.'),
    ('Automated tracks of the paper (Figures 2, 3 and 6, Table 2)', 'Made with TrackMate after '
     'processing whose steps are not given; the tracks here are ours.'),
    ('Despeckling, threshold of the binarisation, mixture of colours, level of the '
     'autocorrelation', 'Not given ("arbitrary"): ours are settings, which '
     '`nanorocks analyse --help-all` lists under preprocess, speed and clusters.'),
    ('Values of Figures 6, 7 (inset), 9, 10 and 14 for single trays', 'Only drawn; the text has '
     'tray 1, ranges, the compactions and three sticking speeds.'),
    ('Table 3 by hand, and the grains of trays 6 to 8 in it', 'Counted here from the truth and '
     'from tracks. Grains are too many to be tracked in trays 6 and 8; the number that the paper '
     'assumes is not printed and was computed from its table.'),
    ('Several clusters at the end of a cycle (Table 3, Figure 8e)', 'Clusters of the campaign '
     'neither break nor stick to walls, so that nearly all beads end in one or two. What kept '
     'them apart in flight is not known: walls that hold slow beads would, '
     'but also gas, charge or the swinging tray.'),
    ('Autocorrelation of trays 2 and 4', 'The paper got no result under chalk either; ours is in '
     'the tables with its status.'),
    ('Dates and periods of larger clusters (Figure 9)', 'The experiment kept no absolute time; '
     'the vibration of the station is not simulated.'),
    ('Sticking in the simulations of the paper (Figures 11 and 12)', 'Its threshold is not given; '
     'it compares the whole relative speed, the cycles here that along the line of centres '
     '(`sticking_measure` is a setting).'),
    ('The chi square of Figures 11 and 12', 'Its units are not given; ours divides by errors.'),
    ('Curves of Weidling and Kothe in Figure 14', 'Their constants could not be traced to a '
     'text; the curves drawn are marked as unverified, and Kothe is missing.'),
    ('Chalk in the bounces of trays 2 and 4, gas drag, friction, rotation', 'The campaign '
     'draws the chalk, but all trays have the same restitutions; the paper gives neither the '
     'pressure nor the friction.'),
    ('The ratio of rotation to translation below 2 mm/s', 'Round beads of one colour do not show '
     'how they turn.'),
)  # fmt: skip


def summary(folder: Path, plan: CampaignPlan, runs: int) -> str:
    """Date, version and command of the report, and the size of its campaign.

    Parameters
    ----------
    folder : Path
    plan : CampaignPlan
    runs : int
        Simulated runs at each point of a search.
    """
    cycles = 'cycle' if plan.cycles == 1 else 'cycles'
    command = (
        f'nanorocks reproduce --cycles {plan.cycles} --runs {runs} --seed {plan.seed} '
        f'--sticking-speed {plan.sticking_speed:g} -o {shlex.quote(str(folder))}'
    )
    return (
        f'{made_line(command)} {plan.cycles} {cycles} '
        f'without and {plan.cycles} with sticking, {plan.seconds:g} s of film each; {runs} runs '
        'at each point of the searches.'
    )


def conclusion(chapters: Sequence[Chapter]) -> str:
    """What follows from the chapters, in one paragraph."""
    findings = [finding for chapter in chapters for finding in chapter.findings]
    return ' '.join(
        [
            'The methods of the paper were repeated on simulated films with a known truth. Their '
            'values test the methods; of the beads of the flight they say nothing.',
            *findings,
            'Each chapter says where the paper errs and why.',
        ]
    )


def differences(chapters: Sequence[Chapter]) -> Section:
    """The table of differences to the paper."""
    return Section(
        title='Differences to the paper',
        parts=[
            Table(
                head=('', 'the paper', 'its method, on our films', 'ours', 'truth'),
                rows=[row for chapter in chapters for row in chapter.differences],
                caption='Values of the flight in the paper; the method of the paper on our films; '
                'our default method on our films; values of the simulation. ± is one standard '
                'error of the mean over the cycles (missing for a single cycle), brackets are '
                'intervals of 95 %.',
            ),
        ],
    )


def limits() -> Section:
    """What cannot be reproduced, and why."""
    return Section(
        title='What cannot be reproduced',
        parts=[Table(head=('what', 'why'), rows=_LIMITS)],
    )
