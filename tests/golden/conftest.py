"""The frozen cases, which the script and the tests share, come onto the path."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
