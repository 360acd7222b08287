"""`python -m usdmlt` is `usdmlt`."""

import sys

from usdmlt.cli import main

sys.exit(main())
