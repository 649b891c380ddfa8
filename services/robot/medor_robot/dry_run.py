"""An arm that moves nothing: it writes down every station it would pass, at the pace of nothing."""

import logging
from collections.abc import Callable

from medor_robot.waypoints import Waypoint

log = logging.getLogger(__name__)


class DryRunArm:
    """Rehearses motions."""

    detail = "dry run: nothing moves"

    def follow(self, stations: list[Waypoint], check: Callable[[], None]) -> bool:
        """Pass the stations, stopping at the first where `check` raises.

        Returns:
            Whether the gripper holds something at the end of the pull: never.
        """
        for number, (point, closed) in enumerate(stations):
            check()
            log.info("dry run %d: tool to %s m, %s", number, point.round(4).tolist(), "closed" if closed else "open")
        return False
