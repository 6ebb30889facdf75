"""Where the installed command begins: what interrupts it while it is still loading waits until the supervisor hears it.

Nothing is imported before the signals are held back. What comes while the interpreter itself starts, some 20 ms, ends
it as it ends any Python program.
"""

import signal

if hasattr(signal, "pthread_sigmask"):
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM, signal.SIGHUP})

from reports.supervisor import main

__all__ = ["main"]
