"""How a request ends that nobody answered."""

import time

import pytest

from medor_wire import endpoints
from medor_wire.asking import Waiter
from medor_wire.errors import MedorError, Timeout, Unavailable
from medor_wire.transport import Answer, Mailbox


@pytest.mark.parametrize(("left_s", "expected"), [(30, Unavailable), (0, Timeout)])
def test_no_answer_is_a_lost_server_before_the_deadline_and_lateness_after_it(
    left_s: float, expected: type[MedorError]
) -> None:
    mailbox = Mailbox()
    mailbox.put(Answer("end"))
    waiter = Waiter(endpoints.STATUS, mailbox, time.monotonic() + left_s, lambda: None)
    with pytest.raises(expected):
        waiter.wait(None)
