"""Processes that end with the one that started them."""

import multiprocessing
import os
import signal
import threading


def end_with_parent() -> None:
    """End this process by SIGTERM when the one that started it is gone, however that ended.

    For a process that `multiprocessing` started. A thread waits for it.
    """
    threading.Thread(target=_end, name="parent", daemon=True).start()


def _end() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os.kill(os.getpid(), signal.SIGTERM)
