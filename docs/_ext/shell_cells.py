"""Start-up of the kernels that run the pages: a cell of shell lines prints all at once, and fails
where a line does.

IPython's own `%%bash` hands the text on in pieces, which pages then show broken between two lines.
"""

from __future__ import annotations

import subprocess


def bash(options: str, lines: str) -> None:
    """Run the lines of a cell, standard output and error together. `-e` as of bash: stop at the
    first that fails.
    """
    run = subprocess.run(
        ["bash", *options.split(), "-c", lines], stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )
    print(run.stdout.decode(), end="")
    run.check_returncode()


get_ipython().register_magic_function(bash, "cell")  # type: ignore[name-defined]  # noqa: F821
