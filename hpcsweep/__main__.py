"""``python -m hpcsweep``."""

import sys

from hpcsweep.commands.cli import main

sys.exit(main())
