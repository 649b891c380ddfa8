"""Run a command that dies with its parent: `python child.py PARENT_PID COMMAND...`.

The kernel is asked to kill the process when its parent is gone (Linux; the order survives `exec`), so that even
`kill -9` of the launcher leaves nothing behind. Elsewhere the command runs without that safeguard.
"""

import ctypes
import os
import signal
import sys

PR_SET_PDEATHSIG = 1


def die_with(parent: int) -> None:
    """Have the kernel kill this process when process `parent`, which started it, ends."""
    if sys.platform != "linux":
        return
    if ctypes.CDLL(None, use_errno=True).prctl(PR_SET_PDEATHSIG, signal.SIGKILL) != 0:
        raise OSError(ctypes.get_errno(), "prctl(PR_SET_PDEATHSIG)")
    if os.getppid() != parent:  # it ended before the order was placed
        sys.exit("the launcher is gone")


def main() -> None:
    parent, *command = sys.argv[1:]
    die_with(int(parent))
    os.execvp(command[0], command)


if __name__ == "__main__":
    main()
