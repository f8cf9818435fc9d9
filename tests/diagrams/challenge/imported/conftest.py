"""The writer of tables in any convention comes onto the path."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
