"""The program `tangent-check`."""

import signal
import sys

from . import _native


def main():
    if not hasattr(_native, "run_program"):
        sys.exit("error: this program loads laws on Linux and macOS only.")
    # Ctrl-C ends the program at once; Python would wait for the end of the check.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(_native.run_program(sys.executable, _native.__file__, sys.argv[1:]))
