"""Time that goes back resets a stage, whatever the stage does."""

from __future__ import annotations

from dataclasses import dataclass

from nanorocks_ros.records import Notice
from nanorocks_ros.stages.stage import RestartingStage


@dataclass(frozen=True)
class Remark:
    """A record that may come in late."""

    stamp_ns: int


class DelayedTexts(RestartingStage[Notice | Remark, str]):
    """Gives out the texts of notices, each when the next one comes in."""

    clock = Notice

    def __init__(self):
        self.restarts = []
        self.reset()
        self.restarts.clear()

    def _restart(self, stamp_ns=None):
        self.restarts.append(stamp_ns)
        self.held = []

    def _process(self, record):
        if isinstance(record, Remark):
            return ()
        given, self.held = tuple(self.held), [record.text]
        return given

    def _interrupted(self):
        return (f'interrupted {self.held[0]}',)

    def flush(self):
        given, self.held = tuple(self.held), []
        return given


def notice(stamp_ns, text):
    return Notice(stamp_ns=stamp_ns, text=text)


def test_a_stage_is_left_alone_while_time_goes_on():
    stage = DelayedTexts()
    assert [stage.push(notice(k, str(k))) for k in range(3)] == [(), ('0',), ('1',)]
    assert stage.flush() == ('2',)
    assert stage.restarts == []


def test_a_stamp_that_goes_back_or_stands_still_resets_the_stage():
    for back in (5, 3):
        stage = DelayedTexts()
        stage.push(notice(5, 'old'))
        assert stage.push(notice(back, 'new')) == ('interrupted old',)
        assert stage.restarts == [back]
        assert stage.flush() == ('new',)


def test_records_that_do_not_tell_the_time_may_come_in_any_order():
    stage = DelayedTexts()
    stage.push(notice(5, 'old'))
    assert stage.push(Remark(1)) == ()
    assert stage.push(notice(6, 'new')) == ('old',)
    assert stage.restarts == []


def test_after_a_reset_any_stamp_is_the_first():
    stage = DelayedTexts()
    stage.push(notice(5, 'old'))
    stage.reset()
    assert stage.push(notice(1, 'new')) == ()
    assert stage.restarts == [None]
