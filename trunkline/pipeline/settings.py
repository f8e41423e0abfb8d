"""``python -m trunkline.pipeline.settings``: check every stage's settings before anything runs."""

import sys

from trunkline.config import check_settings
from trunkline.errors import InputError


def main() -> int:
    try:
        stages = check_settings()
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(f"settings: {len(stages)} stages checked")
    return 0


if __name__ == "__main__":
    sys.exit(main())
