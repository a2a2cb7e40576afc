"""A worker process: reads pickled (function, argument) from standard input, writes pickled results to standard output,
until the input ends."""

from __future__ import annotations

import os
import pickle
import signal
import sys


def main() -> None:
    """Serve. What a function prints goes to standard error; an interrupt is left to the parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    results = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    while True:
        try:
            function, argument = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        pickle.dump(function(argument), results)
        results.flush()


if __name__ == "__main__":
    main()
